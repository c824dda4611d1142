"""Which participant and condition a log is of, by the names of all logs: the pattern for `sessions` in study.yaml."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

_TOKEN = re.compile(r"[^_/]+|[_/]")
_OF_A_PERSON = re.compile(r"(?:p|vp|s|sub|subj|subject|tn|user|proband|participant|id)?[-]?\d+", re.IGNORECASE)


@dataclass(frozen=True)
class NamePattern:
    """A pattern such as data/{participant}_{condition}.mcap, and what its placeholders stand for, name by name."""

    pattern: str
    participants: tuple[str, ...]
    every_condition: tuple[str, ...]
    sessions: tuple[str, ...] = ()

    @property
    def conditions(self) -> tuple[str, ...]:
        """The different conditions, in the order of the names."""
        return tuple(dict.fromkeys(self.every_condition))


def guess_pattern(
    names: Sequence[str], conditions: Sequence[str], suffix: str, every_part: bool = True
) -> NamePattern | None:
    """The pattern of paths in a study folder, of one suffix; None where the names are not built alike.

    Parts between "_" and "/" that differ are placeholders: the condition is the part with the fewest different words
    of those that every participant has, or the one that has the `conditions` known already; the participant is the part
    that looks like an id. One more part that differs is the session. With `every_part`, a part that is the same in all
    names may be the participant or condition too, of logs that are all of one.
    """
    tokens = [_TOKEN.findall(name.removesuffix(suffix)) for name in names]
    if len({len(one) for one in tokens}) != 1:
        return None
    columns = list(zip(*tokens, strict=True))
    differing = [place for place, column in enumerate(columns) if len(set(column)) > 1]
    if any(column[0] in "_/" for place, column in enumerate(columns) if place in differing):
        return None
    roles = _roles(columns, differing, conditions)
    if roles is None:
        return None
    if every_part:
        roles |= _same_everywhere(columns, roles)
    pieces = [f"{{{roles[place]}}}" if place in roles else column[0] for place, column in enumerate(columns)]
    by_role = {role: columns[place] for place, role in roles.items()}
    return NamePattern(
        "".join(pieces) + suffix,
        tuple(by_role.get("participant", ())),
        tuple(by_role.get("condition", ())),
        tuple(by_role.get("session", ())),
    )


def _roles(
    columns: Sequence[tuple[str, ...]], differing: Sequence[int], conditions: Sequence[str]
) -> dict[int, str] | None:
    """Which differing part is what, by its place; None where there are more parts than placeholders."""
    if not differing or len(differing) > 3:
        return None
    left = list(differing)
    roles: dict[int, str] = {}
    condition = _condition(columns, left, conditions)
    if condition is not None:
        roles[condition] = "condition"
        left.remove(condition)
    people = sorted(left, key=lambda place: (not _looks_like_ids(columns[place]), -len(set(columns[place]))))
    for place, role in zip(people, ("participant", "session"), strict=False):
        roles[place] = role
    return roles if len(roles) == len(differing) else None


def _same_everywhere(columns: Sequence[tuple[str, ...]], roles: dict[int, str]) -> dict[int, str]:
    """The participant or condition of logs that are all of one, in the file's name: P01 in P01_slow and P01_fast."""
    words = [column[0] for column in columns]
    first = len(words) - words[::-1].index("/") if "/" in words else 0
    free = [place for place in range(first, len(words)) if place not in roles and words[place] != "_"]
    found: dict[int, str] = {}
    if "participant" not in roles.values():
        found |= {place: "participant" for place in free if _looks_like_ids([words[place]])}
    if "condition" not in roles.values():
        found |= {place: "condition" for place in free[-1:] if place not in found}
    return found if len(set(found.values())) == len(found) else {}


def _condition(columns: Sequence[tuple[str, ...]], places: Sequence[int], conditions: Sequence[str]) -> int | None:
    known = [place for place in places if conditions and set(columns[place]) <= set(conditions)]
    if known:
        return known[0]
    words = [place for place in places if not _looks_like_ids(columns[place])]
    fewest = sorted(words, key=lambda place: len(set(columns[place])))
    return next((place for place in fewest if len(set(columns[place])) < len(columns[place])), None)


def _looks_like_ids(words: Sequence[str]) -> bool:
    return all(_OF_A_PERSON.fullmatch(word) for word in words)

"""A session, and the pattern that its file's name follows."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import did_you_mean

PLACEHOLDER = re.compile(r"\{(\w+)\}")


PLACEHOLDERS = ("participant", "condition", "session")

ANY = "*"
"""In the last part of a pattern: any text, so that several files may be one session."""


def check_pattern(pattern: str, conditions: tuple[str, ...]) -> None:
    """Raise ValueError where a pattern of sessions has no placeholder, an unknown one, or cannot match a condition."""
    names = PLACEHOLDER.findall(pattern)
    for name in names:
        if name not in PLACEHOLDERS:
            raise ValueError(f'sessions: placeholder "{{{name}}}" is not known{did_you_mean(name, PLACEHOLDERS)}')
    if not names:
        raise ValueError("sessions: needs a placeholder, such as data/{participant}_{condition}.mcap")
    if ANY in Path(pattern).parent.as_posix():
        raise ValueError('sessions: "*" may stand only in the name of the file, behind the last "/"')
    for condition in conditions:
        if "condition" in names and ("_" in condition or "/" in condition):
            raise ValueError(
                f'sessions: {{condition}} stands for text without "_" and "/", so no log can be of "{condition}"; '
                "rename the condition, or use {session} and let the logs' metadata say it"
            )


def expression(pattern: str) -> re.Pattern[str]:
    """The regular expression of a pattern of names, in which a placeholder may stand more than once."""
    text, seen = "", set[str]()
    for index, piece in enumerate(PLACEHOLDER.split(pattern)):
        if index % 2 == 0:
            text += re.escape(piece).replace(re.escape(ANY), "[^/]*")
        else:
            text += f"(?P={piece})" if piece in seen else f"(?P<{piece}>[^_/]+)"
            seen.add(piece)
    return re.compile(text)


@dataclass(frozen=True)
class Session:
    """One participant in one condition, which is one log. `participant` and `condition` are None if not yet known.

    `path` is its file, or the folder of its `parts` where there are several.
    """

    id: str
    participant: str | None
    condition: str | None
    path: Path
    parts: tuple[Path, ...] = ()

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file of its log."""
        return self.parts or (self.path,)

    @property
    def ids(self) -> dict[str, str | None]:
        """Its columns in tables: participant, condition, session."""
        return {"participant": self.participant, "condition": self.condition, "session": self.id}

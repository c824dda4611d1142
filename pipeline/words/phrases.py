"""Lists, counts and capitals in a sentence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from pipeline.words.numbers import number


def listing(words: list[str]) -> str:
    """`a, b and c`, of at least one word."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def counted(count: int, noun: str, plural: str | None = None) -> str:
    """`1 session`, `3 sessions`, `2 932 selections`."""
    return f"{number(count, 0)} {noun if count == 1 else plural or noun + 's'}"


def all_of(count: int, noun: str) -> str:
    """`The 1 comparison`, `Both comparisons`, `All 3 comparisons`."""
    return {1: f"The 1 {noun}", 2: f"Both {noun}s"}.get(count, f"All {counted(count, noun)}")


def there_were(facts: Mapping[str, Any], who: str = "") -> str:
    """`There was 1 participant`, `There were 12 participants`; `who` tells of them."""
    return f"There {'was' if facts['n'] == 1 else 'were'} {participants_counted(facts, who)}"


def group_sizes(rows: Iterable[Mapping[str, Any]]) -> str:
    """`group: 4 novice and 3 expert`, from rows of `descriptives_by_group`; the largest of each group's measures."""
    sizes: dict[str, dict[str, int]] = {}
    for row in rows:
        of_factor = sizes.setdefault(row["factor"], {})
        of_factor[row["group"]] = max(of_factor.get(row["group"], 0), row["group_n"])
    return "; ".join(f"{factor}: {listing([f'{n} {name}' for name, n in of.items()])}" for factor, of in sizes.items())


def capitalized(sentence: str) -> str:
    """The sentence with a capital letter first. The rest is left alone: names such as NASA-TLX keep their capitals."""
    return sentence[:1].upper() + sentence[1:]


def participants_counted(facts: Mapping[str, Any], who: str = "") -> str:
    """`12 participants`, or `10 participants analysed of 12 listed` where not all are; `who` tells of them."""
    people, listed = f"{counted(facts['n'], 'participant')}{who}", facts.get("listed", facts["n"])
    if facts["n"] == listed:
        return people
    return f"{people} analysed of {listed} listed" if facts["n"] < listed else f"{people} analysed, {listed} listed"


def one_line(text: str) -> str:
    """Text of a log or a table, in which a line break must not begin what looks like a line of Steadyhand's own."""
    return text.replace("\n", "□")

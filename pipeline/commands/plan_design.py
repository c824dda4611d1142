"""The design of a plan, and what each participant does in it: plain data, nothing printed or written."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from pipeline.errors import PipelineError
from pipeline.statistics.counterbalancing import Order, allocated, assigned, nested
from pipeline.study.fields import identifier

# Each part of the design draws from a stream of its own, so that adding one leaves the others as they were.
_GROUPS, _ORDERS, _LEVELS, _TARGETS = range(1, 5)


@dataclass(frozen=True)
class Factor:
    """A factor and its levels, as `task=easy,hard` states them."""

    name: str
    levels: tuple[str, ...]


@dataclass(frozen=True)
class Design:
    """The design that the options state. `within` is crossed with the conditions, `between` divides participants."""

    conditions: tuple[str, ...]
    participants: int
    seed: int | None = None
    within: Factor | None = None
    between: Factor | None = None
    blocks: int = 1
    targets: tuple[str, ...] = ()


@dataclass(frozen=True)
class Person:
    """What one participant does: the group's place, the order of conditions, and in each condition that of levels."""

    group: int | None
    order: Order
    levels: tuple[Order, ...]


@dataclass(frozen=True)
class Block:
    """One block of one participant: its condition and period, the level of the further factor, and the targets."""

    person: int
    period: int
    condition: str
    level: str | None
    number: int
    targets: tuple[str, ...]


def factor(option: str, text: str) -> Factor:
    """The factor that an option states, such as `task=easy,hard`. Raises PipelineError for anything else."""
    name, equals, levels = text.partition("=")
    listed = [str(identifier(level.strip())) for level in levels.split(",")]
    if not equals or not name.strip() or len(listed) < 2 or not all(listed):
        raise PipelineError(f"{option} {text}: needs a name and at least two levels, as in {option} task=easy,hard")
    for each in (name, *listed):
        require_printable(option, each)
        if listed.count(each) > 1:
            raise PipelineError(f'{option}: level "{each}" is listed twice')
    return Factor(name.strip(), tuple(listed))


def require_printable(what: str, text: str) -> None:
    """Refuse control characters: a line break or an escape sequence in an id is a mistake, or worse."""
    if any(unicodedata.category(character) in ("Cc", "Cs") for character in text):
        raise PipelineError(f"plan: {what} {text!r} contains a character that cannot be printed; leave it out")


def people(design: Design) -> list[Person]:
    """Every participant; orders are balanced within each group, as if it were a study of its own."""
    groups: list[int | None] = [None] * design.participants
    if design.between is not None:
        groups = list(allocated(len(design.between.levels), design.participants, _seed(design, _GROUPS)))
    by_group = {group: _people_of_group(design, group, groups.count(group)) for group in dict.fromkeys(groups)}
    return [next(by_group[group]) for group in groups]


def _people_of_group(design: Design, group: int | None, count: int) -> Iterator[Person]:
    conditions = len(design.conditions)
    if conditions < 2:
        yield from [Person(group, (), ())] * count
        return
    # Without groups the orders are drawn from the seed itself, as they were before there were groups.
    seed = design.seed if group is None else _seed(design, _ORDERS, group)
    orders = assigned(conditions, count, seed)
    levels: Sequence[tuple[Order, ...]] = [()] * count
    if design.within is not None:
        levels = nested(conditions, len(design.within.levels), count, _seed(design, _LEVELS, group or 0))
    for order, of_person in zip(orders, levels, strict=True):
        yield Person(group, order, of_person)


def _seed(design: Design, *stream: int) -> tuple[int, ...] | None:
    return None if design.seed is None else (design.seed, *stream)


def schedule(design: Design, planned: Sequence[Person]) -> Iterator[Block]:
    """Every block in the order in which it is run. Over all blocks each target comes equally often in each place."""
    levels_in_each = len(design.within.levels) if design.within is not None else 1
    blocks = len(planned) * len(design.conditions) * levels_in_each * design.blocks
    orders: Iterator[Order] = iter(())
    if design.targets:
        orders = iter(assigned(len(design.targets), blocks, _seed(design, _TARGETS)))
    for index, person in enumerate(planned):
        for period, condition in enumerate(person.order, start=1):
            for level in person.levels[condition] if design.within is not None else (None,):
                for number in range(1, design.blocks + 1):
                    targets = tuple(design.targets[place] for place in next(orders)) if design.targets else ()
                    name = None if level is None or design.within is None else design.within.levels[level]
                    yield Block(index, period, design.conditions[condition], name, number, targets)

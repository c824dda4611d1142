"""`plan`: a participants table with everybody's group and order of the conditions, and a schedule of every block."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from pipeline.commands import console
from pipeline.commands.plan_design import Design, Person, factor, people, require_printable, schedule
from pipeline.errors import PipelineError
from pipeline.statistics.counterbalancing import Order, balance, williams_design
from pipeline.study.fields import identifier
from pipeline.study.folder import load_study
from pipeline.words.phrases import counted, listing

_NAMED_AS = "name them as study.yaml does, as in: steadyhand plan kinect fusion --participants 12"
_RESERVED = ("participant", "sequence", "condition", "period", "block", "targets")
_TARGETS_MAX = 100


@dataclass(frozen=True)
class Options:
    """The options of `plan`, as the command line states them."""

    names: Sequence[str]
    study: Path | None
    participants: int | None
    prefix: str
    seed: int | None
    cross: str | None
    between: str | None
    blocks: int
    targets: str | None


def plan(options: Options, out: Path | None, schedule_file: Path | None) -> None:
    """Print the table or write it to `out`, write the schedule, and print how balanced the plan is.

    Raises PipelineError for options that contradict each other and for files that exist already.
    """
    design = _design(options)
    require_printable("--prefix", options.prefix)
    if (design.blocks > 1 or design.targets) and schedule_file is None:
        raise PipelineError("--blocks and --targets go into a table of their own; name it, as in --schedule blocks.csv")
    planned = people(design)
    width = max(2, len(str(design.participants)))
    ids = [f"{options.prefix}{number:0{width}d}" for number in range(1, design.participants + 1)]
    text = _as_csv(_rows(design, planned, ids))
    for path, option in ((out, "--out"), (schedule_file, "--schedule")):
        _refuse_existing(path, option)
    if out is None:
        print(text, end="", flush=True)  # noqa: T201 - the bytes of the file, whatever the names hold
    else:
        _write(out, text)
        met = design.conditions or (design.between.levels if design.between else ())
        console.say(f"{out}: {counted(design.participants, 'participant')}, {counted(len(met), 'condition')}")
    if schedule_file is not None:
        _write(schedule_file, _as_csv(_blocks(design, planned, ids)))
        console.warn(f"{schedule_file}: every block")
    for line in _balance_lines(design, planned):
        console.warn(line)


def _design(options: Options) -> Design:
    within = None if options.cross is None else factor("--cross", options.cross)
    between = None if options.between is None else factor("--between", options.between)
    for option, stated in (("--cross", within), ("--between", between)):
        reserved = _RESERVED if option == "--cross" else [name for name in _RESERVED if name != "condition"]
        if stated is not None and (stated.name in reserved or stated.name.startswith("period_")):
            raise PipelineError(
                f'{option}: a factor cannot be called "{stated.name}", the plan has such a column already'
            )
    if within is not None and between is not None and within.name == between.name:
        raise PipelineError(f'--cross and --between are both called "{within.name}"; each factor needs its own name')
    one_condition_each = between is not None and between.name == "condition"
    if one_condition_each and (options.names or options.study or within):
        raise PipelineError("--between condition=… is for participants who meet one condition each; name no others")
    if one_condition_each and (options.blocks > 1 or options.targets):
        raise PipelineError("--between condition=…: blocks and targets need conditions that participants meet in turn")
    conditions = [] if one_condition_each else _conditions(options.names, options.study)
    if options.participants is None:
        raise PipelineError("plan: how many participants? Give --participants, as in -n 12")
    return Design(
        tuple(conditions),
        options.participants,
        options.seed,
        within,
        between,
        options.blocks,
        _targets(options.targets),
    )


def _conditions(names: Sequence[str], study: Path | None) -> list[str]:
    if study is not None and names:
        raise PipelineError("plan: conditions are given both on the command line and by --study; give only one of them")
    conditions = [str(identifier(name.strip())) for name in (load_study(study).conditions if study else names)]
    for name in conditions:
        if conditions.count(name) > 1:
            raise PipelineError(f'plan: condition "{name}" is listed twice; {_NAMED_AS}')
        if not name:
            raise PipelineError(f"plan: a condition has no name; {_NAMED_AS}")
        require_printable("condition", name)
    if len(conditions) < 2:
        raise PipelineError(f"plan: an order needs at least two conditions, found {len(conditions)}; {_NAMED_AS}")
    return conditions


def _targets(text: str | None) -> tuple[str, ...]:
    """The names of the targets: as listed, or 1, 2, … of a number."""
    if text is None:
        return ()
    names = tuple(str(place) for place in range(1, int(text) + 1)) if text.isdecimal() else tuple(text.split(","))
    names = tuple(name.strip() for name in names)
    if not 2 <= len(names) <= _TARGETS_MAX or len(set(names)) < len(names) or not all(names):
        raise PipelineError(
            f"--targets {text}: needs 2 to {_TARGETS_MAX} targets, each once: a number, or names as in --targets a,b,c"
        )
    for name in names:
        require_printable("--targets", name)
    return names


def _rows(design: Design, planned: Sequence[Person], ids: Sequence[str]) -> Iterator[list[str]]:
    """One row per participant, the header first: group, the sequence as a label, and a column for each period.

    With a further factor there is a column for each period too that has the order of its levels there.
    """
    periods = range(1, len(design.conditions) + 1)
    header = ["participant", *([design.between.name] if design.between else [])]
    header += ["sequence"] if design.conditions else []
    header += [f"period_{period}" for period in periods]
    yield [*header, *(f"{design.within.name}_{period}" for period in periods if design.within)]
    for person, name in zip(planned, ids, strict=True):
        row = [name, *([_group(design, person)] if design.between else [])]
        conditions = [design.conditions[at] for at in person.order]
        row += [" > ".join(conditions)] if conditions else []
        levels = design.within.levels if design.within else ()
        yield [*row, *conditions, *(_in_order(levels, person.levels[at]) for at in person.order if levels)]


def _blocks(design: Design, planned: Sequence[Person], ids: Sequence[str]) -> Iterator[list[str]]:
    """One row per block, the header first."""
    between, within = design.between, design.within
    header = ["participant", *([between.name] if between else []), "period", "condition"]
    yield [*header, *([within.name] if within else []), "block", *(["targets"] if design.targets else [])]
    for block in schedule(design, planned):
        row = [ids[block.person], *([_group(design, planned[block.person])] if between else [])]
        row += [str(block.period), block.condition, *([block.level or ""] if within else []), str(block.number)]
        yield [*row, *([" > ".join(block.targets)] if design.targets else [])]


def _group(design: Design, person: Person) -> str:
    return "" if design.between is None or person.group is None else design.between.levels[person.group]


def _in_order(names: Sequence[str], order: Order) -> str:
    return " > ".join(names[place] for place in order)


def _as_csv(rows: Iterable[list[str]]) -> str:
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerows(rows)
    return buffer.getvalue()


def _refuse_existing(path: Path | None, option: str) -> None:
    if path is not None and path.exists():
        raise PipelineError(f"{option} {path}: already exists; choose another file, or remove this one")


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8", newline="\n")


# How balanced it is -----------------------------------------------------------------------------------------------


def _balance_lines(design: Design, planned: Sequence[Person]) -> Iterator[str]:
    """Group sizes, and how balanced the orders are within each group, counted from the plan itself."""
    if design.between is None:
        yield from _balance_of_orders(design, planned)
        return
    sizes = Counter(_group(design, person) for person in planned)
    yield f"{design.between.name}: {listing([f'{sizes[level]} {level}' for level in design.between.levels])}."
    for level in design.between.levels:
        members = [person for person in planned if _group(design, person) == level]
        if members and design.conditions:
            yield f"{level}:"
            yield from (f"  {line}" for line in _balance_of_orders(design, members))


def _balance_of_orders(design: Design, planned: Sequence[Person]) -> Iterator[str]:
    """How often each condition is in each period and follows each other one, and where each level comes first."""
    conditions, orders = design.conditions, [person.order for person in planned]
    counts = balance(orders)
    yield (
        f"Each condition is in each period {_times(counts.period)},"
        f" and directly follows each other one {_times(counts.neighbours)}."
    )
    if design.within is not None:
        first = Counter(
            (at, period, person.levels[at][0]) for person in planned for period, at in enumerate(person.order)
        )
        places = range(len(conditions))
        first_counts = [
            first[at, period, level] for at in places for period in places for level in range(len(design.within.levels))
        ]
        yield (
            f"In each condition and period each level of {design.within.name} comes first"
            f" {_times((min(first_counts), max(first_counts)))}."
        )
    if counts.complete:
        yield "Counterbalancing is complete."
        return
    size, n = len(williams_design(len(conditions))), len(orders)
    multiples = [str(number) for number in (n // size * size, (n // size + 1) * size) if number]
    yield (
        f"Counterbalancing is incomplete: {len(conditions)} conditions take {size} sequences, which"
        f" {counted(n, 'participant')} cannot share evenly; {' or '.join(multiples)} participants could."
    )


def _times(bounds: tuple[int, int]) -> str:
    low, high = bounds
    if low == high:
        return counted(low, "time")
    return f"{low} {'or' if high == low + 1 else 'to'} {high} times"

"""`plan`: who does the conditions in which order, as a participants table."""

from __future__ import annotations

import csv
import io
import unicodedata
from collections.abc import Sequence
from pathlib import Path

from pipeline.commands import console
from pipeline.errors import PipelineError
from pipeline.statistics.counterbalancing import Order, assigned, balance, williams_design
from pipeline.study.fields import identifier
from pipeline.study.folder import load_study
from pipeline.words import counted

_NAMED_AS = "name them as study.yaml does, as in: steadyhand plan kinect fusion --participants 12"


def plan(
    names: Sequence[str], study: Path | None, participants: int, *, prefix: str, seed: int | None, out: Path | None
) -> None:
    """Print the table, or write it to `out`; beside it, print how balanced it is."""
    conditions = _conditions(names, study)
    _printable("--prefix", prefix)
    orders = assigned(len(conditions), participants, seed)
    text = _table(conditions, orders, prefix)
    if out is None:
        print(text, end="", flush=True)  # noqa: T201 - the bytes of the file, whatever the names hold
    else:
        _write(out, text)
        console.say(f"{out}: {counted(participants, 'participant')}, {counted(len(conditions), 'condition')}")
    for line in _balance_lines(conditions, orders):
        console.warn(line)


def _conditions(names: Sequence[str], study: Path | None) -> list[str]:
    if study is not None and names:
        raise PipelineError("plan: conditions are given both on the command line and by --study; give only one of them")
    conditions = [str(identifier(name.strip())) for name in (load_study(study).conditions if study else names)]
    for name in conditions:
        if conditions.count(name) > 1:
            raise PipelineError(f'plan: condition "{name}" is listed twice; {_NAMED_AS}')
        if not name:
            raise PipelineError(f"plan: a condition has no name; {_NAMED_AS}")
        _printable("condition", name)
    if len(conditions) < 2:
        raise PipelineError(f"plan: an order needs at least two conditions, found {len(conditions)}; {_NAMED_AS}")
    return conditions


def _printable(what: str, text: str) -> None:
    """Refuse control characters: a line break or an escape in an id is a slip of the keyboard or worse."""
    if any(unicodedata.category(character) in ("Cc", "Cs") for character in text):
        raise PipelineError(f"plan: {what} {text!r} contains a character that cannot be printed; leave it out")


def _table(conditions: Sequence[str], orders: Sequence[Order], prefix: str) -> str:
    """CSV with one row per participant: the sequence as a label, and a column for each period."""
    width = max(2, len(str(len(orders))))
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(["participant", "sequence", *(f"period_{place}" for place in range(1, len(conditions) + 1))])
    for number, order in enumerate(orders, start=1):
        run = [conditions[at] for at in order]
        writer.writerow([f"{prefix}{number:0{width}d}", " > ".join(run), *run])
    return buffer.getvalue()


def _write(path: Path, text: str) -> None:
    if path.exists():
        raise PipelineError(f"--out {path}: already exists; choose another file, or remove this one")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8", newline="\n")


def _balance_lines(conditions: Sequence[str], orders: Sequence[Order]) -> list[str]:
    """How often each condition is in each period and follows each other one, counted from the orders."""
    counts = balance(orders)
    lines = [
        f"Each condition is in each period {_times(counts.period)},"
        f" and directly follows each other one {_times(counts.neighbours)}."
    ]
    if counts.complete:
        return [*lines, "Counterbalancing is complete."]
    size, n = len(williams_design(len(conditions))), len(orders)
    fitting = [str(many) for many in (n // size * size, (n // size + 1) * size) if many]
    return [
        *lines,
        f"Counterbalancing is incomplete: {len(conditions)} conditions take {size} sequences, which"
        f" {counted(n, 'participant')} cannot share evenly; {' or '.join(fitting)} participants could.",
    ]


def _times(bounds: tuple[int, int]) -> str:
    low, high = bounds
    if low == high:
        return counted(low, "time")
    return f"{low} {'or' if high == low + 1 else 'to'} {high} times"

"""The report of an exploration: whether a better tracker or a better filter pays, and the surfaces behind it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from pipeline.report.document.model import Block, Document, Notice, Paragraph, Section, Strong, Table, columns
from pipeline.report.figures.exploration import ERROR, NAMES, TIME, outcome, participants
from pipeline.report.sections.material import draw_now
from pipeline.report.sections.provenance import program
from pipeline.simulation.tracker import Tracker
from pipeline.simulation.what_pays import MEASURES, MOST, POWER, Pays, Way
from pipeline.study.settings import Study
from pipeline.tables.table import Row, records
from pipeline.words.change import reduction_phrase
from pipeline.words.names import short_label
from pipeline.words.numbers import NO_VALUE, interval, number, percent
from pipeline.words.phrases import counted, listing

ORIGIN = "Simulated participants; direction and rough size only."
_ROWS_MAX = 150
_UNITS = dict(zip(MEASURES, ("mm", "s"), strict=True))


@dataclass(frozen=True)
class Explored:
    """The results of an exploration: its tables, and what pays more for each measure.

    `own` is the study's present tracker; `participants` people were simulated in each of `repeats` small studies.
    """

    name: str
    study: Study
    tables: Mapping[str, pd.DataFrame]
    pays: tuple[Pays, ...]
    own: Tracker
    participants: int
    repeats: int

    def rows(self, table: str) -> list[dict[str, Any]]:
        """A table as plain rows."""
        return list(records(table, self.tables[table]))


def document(explored: Explored, drawn: Path) -> Document:
    """The whole report; its figures go into the folder `drawn`."""
    sections = [
        Section("pays", "What pays more here?", tuple(_pays(explored))),
        Section("surfaces", "Error and time over trackers and estimators", tuple(_surfaces(explored, drawn))),
    ]
    if len(explored.tables["explore_differences"]):
        sections.append(Section("needed", "How many participants show a difference?", tuple(_needed(explored, drawn))))
    sections.append(Section("how", "How this was explored", (_how(explored), program())))
    return Document("A better tracker or a better filter?", f"Study “{explored.name}”", ORIGIN, tuple(sections))


def pays_sentence(pays: Pays, estimator: str) -> Sequence[str]:
    """What pays more for one measure, and its evidence; `estimator` is the first explored."""
    name, now, by_filter, by_tracker = NAMES[pays.measure], pays.now, pays.by_filter, pays.by_tracker
    head = {
        "filter": f"For {name} a better filter pays more",
        "tracker": f"For {name} a better tracker pays more",
        "equal": f"For {name} a better filter and a better tracker cannot be told apart",
        "neither": f"For {name} neither a better filter nor a better tracker clearly pays",
        None: f"For {name} there is nothing to compare",
    }[pays.verdict]
    parts = []
    if by_filter is not None:
        parts.append(f"{by_filter.estimator} in place of {estimator} {_change(pays, by_filter)}")
    if by_tracker is not None:
        parts.append(
            f"a tracker with {_better(by_tracker.tracker, now.tracker)} under {estimator} {_change(pays, by_tracker)}"
        )
    if by_filter is not None and pays.enough is not None and pays.verdict != "filter":
        parts.append(f"one with {_better(pays.enough.tracker, now.tracker)} would already do as much as the filter")
    start = f"from {_figure(pays, now)} with {estimator} at {_tracker_text(now.tracker)}"
    return head, f": {start}, {'; '.join(parts) or 'no other estimator and no better tracker was explored'}."


def _figure(pays: Pays, way: Way) -> str:
    return f"{number(way.value, 1)} {_UNITS[pays.measure]}"


def _change(pays: Pays, way: Way) -> str:
    """`makes it 5.2 mm (reduced by 43.0 %)`."""
    return f"makes it {_figure(pays, way)} ({reduction_phrase(1 - way.value / pays.now.value)})"


def _tracker_text(tracker: Tracker) -> str:
    return f"{1000 * tracker.latency_s:g} ms, {tracker.noise_sd_mm:g} mm and {tracker.rate_hz:g} Hz"


def _better(tracker: Tracker, now: Tracker) -> str:
    """`a latency of 50 ms`: what of a tracker is better than now."""
    words = (
        f"a latency of {1000 * tracker.latency_s:g} ms",
        f"a noise of {tracker.noise_sd_mm:g} mm",
        f"a rate of {tracker.rate_hz:g} Hz",
    )
    return listing([text for text, new, was in zip(words, tracker, now, strict=True) if new != was])


def _pays(explored: Explored) -> Iterator[Block]:
    for pays in explored.pays:
        head, evidence = pays_sentence(pays, pays.now.estimator)
        yield Paragraph((Strong(head), evidence))
    yield Notice(
        "Simulated participants",
        (
            (
                "People were simulated who see the display alone. Use this for the direction and rough size of"
                " effects and to choose the next study, not as a forecast of seconds, millimetres or participants.",
            ),
            (
                "The best of several trackers or filters is partly the best by chance. Two of them, or one and the"
                " present state, count as different where the 95 % interval of their difference, person by person,"
                " excludes zero.",
            ),
        ),
    )
    yield _steps(explored)


def _steps(explored: Explored) -> Table:
    """The present state, each single improvement of the tracker, each other filter, and the best of all points."""
    own, rows = explored.own, explored.rows("explore")
    first = rows[0]["estimator"]
    here = next(row for row in rows if _tracker_of(row) == own and row["estimator"] == first)
    single = [row for row in rows if _tracker_of(row).at_least(own) and _differing_values(_tracker_of(row), own) == 1]
    shown = [
        ("as it is", here),
        *((f"filter: {row['estimator']}", row) for row in rows if _tracker_of(row) == own and row is not here),
        *((f"tracker: {_better(_tracker_of(row), own)}", row) for row in single if row["estimator"] == first),
    ]
    no_worse = [row for row in rows if _tracker_of(row).at_least(own)]
    best = min(no_worse, key=lambda row: row["selection_rmse_mm"] or float("inf"))
    shown.append((f"least error of all: {best['estimator']} at {_tracker_text(_tracker_of(best))}", best))
    cells = tuple((name, *_outcome(row), *(_less(row, here, column) for column in _COLUMNS)) for name, row in shown)
    titles = ("Step", "Error, RMSE (mm)", "Time (s)", "Error less by", "Time less by")
    caption = f"What single steps change, from {first} at {_tracker_text(own)}."
    return Table("table-steps", caption, columns(titles, 1), cells, _INTERVALS)


_COLUMNS = ("selection_rmse_mm", "completion_time_s")
_INTERVALS = (
    "In brackets 95 % t intervals over people; of the error, the root of the interval of the mean square. They say how"
    " precisely the simulation estimates its own mean, not how realistic it is."
)


def _tracker_of(row: Row) -> Tracker:
    return Tracker(*(row[name] for name in Tracker._fields))


def _differing_values(tracker: Tracker, own: Tracker) -> int:
    return sum(new != was for new, was in zip(tracker, own, strict=True))


def _outcome(row: Row) -> tuple[str, str]:
    return _with_interval(row, "selection_rmse", "_mm"), _with_interval(row, "completion_time", "_s")


def _with_interval(row: Row, name: str, unit: str) -> str:
    bounds = interval(row[f"{name}_low{unit}"], row[f"{name}_high{unit}"], 1)
    return number(row[f"{name}{unit}"], 1) + ("" if bounds == NO_VALUE else f" {bounds}")


def _less(row: Row, here: Row, column: str) -> str:
    if row is here or row[column] is None or not here[column]:
        return NO_VALUE
    return percent(round(1 - row[column] / here[column], 2) + 0.0, 0)  # a zero without a sign


def _surfaces(explored: Explored, drawn: Path) -> Iterator[Block]:
    table = explored.tables["explore"]
    text = (
        "Each cell is a tracker, and the darker it is, the smaller the error or the time. Compare the cells of a panel"
        " for what a better tracker does, and panels for what a better filter does."
    )
    yield Paragraph((text,))
    for surface, name in ((ERROR, "error"), (TIME, "time")):
        yield draw_now(drawn / f"{name}.svg", outcome, table, surface, explored.own)
    rows = explored.rows("explore")
    titles = ("Estimator", "Latency (ms)", "Noise (mm)", "Rate (Hz)", "Error, RMSE (mm)", "Time (s)", "Misses", "Left")
    cells = tuple(
        (row["estimator"], *_tracker_cells(row), *_outcome(row), _share_missed(row), str(row["not_selected"]))
        for row in rows[:_ROWS_MAX]
    )
    note = (
        f"{_INTERVALS} Misses: selections outside the target. Left: targets that nobody selected before the session"
        " was ended; such a session's time runs to its last selection."
    )
    people = rows[0]["people"]
    yield Table("table-points", f"Every point, {people} people each.{_more(rows)}", columns(titles, 1), cells, note)


def _share_missed(row: Row) -> str:
    return percent(row["misses"] / row["selections"], 1) if row["selections"] else NO_VALUE


def _tracker_cells(row: Row) -> tuple[str, str, str]:
    return f"{1000 * row['latency_s']:g}", f"{row['noise_sd_mm']:g}", f"{row['rate_hz']:g}"


def _more(rows: Sequence[Row]) -> str:
    return f" The first {_ROWS_MAX} of {len(rows)}; all are in results.json." if len(rows) > _ROWS_MAX else ""


def _needed(explored: Explored, drawn: Path) -> Iterator[Block]:
    table = explored.tables["explore_differences"]
    yield Paragraph(
        (
            "So many participants, each with both estimators, would show the difference with a power of"
            f" {percent(POWER, 0)} in a two-sided paired t test at the study's alpha of {explored.study.alpha:g}"
            " (noncentral t), if the difference between real people were as between simulated ones.",
        )
    )
    for measure in MEASURES:
        of_measure = table[table["measure"] == measure]
        yield draw_now(drawn / f"participants-{measure}.svg", participants, of_measure, explored.own)
    rows = explored.rows("explore_differences")
    titles = ("Measure", "Pair", "Latency (ms)", "Noise (mm)", "Rate (Hz)", "Difference", "d_z", "Participants")
    cells = tuple(_difference_cells(row) for row in rows[:_ROWS_MAX])
    note = (
        "Difference: first less second, the mean over people with its 95 % t interval; of the error, mean squares in"
        f" mm², as the study tests them. Participants: in brackets what the 95 % interval of d_z allows; > {MOST} where"
        " that includes no difference."
    )
    caption = f"Differences between estimators at each tracker.{_more(rows)}"
    yield Table("table-differences", caption, columns(titles, 2), cells, note)


def _difference_cells(row: Row) -> tuple[str, ...]:
    difference = number(row["mean_difference"], 1)
    if row["ci_low"] is not None:
        difference += f" {interval(row['ci_low'], row['ci_high'], 1)}"
    return (
        short_label(row["measure"]),
        f"{row['first']} or {row['second']}",
        *_tracker_cells(row),
        difference,
        number(row["effect_size"]),
        _people(row) if row["status"] == "ok" else str(row["status"]),
    )


def _people(row: Row) -> str:
    needed, low, high = (row[f"participants_{end}"] for end in ("needed", "low", "high"))
    most = f"> {MOST}"
    return f"{needed or most} [{low or most}, {high or most}]"


def _how(explored: Explored) -> Paragraph:
    settings = explored.study.simulation
    assert settings is not None  # noqa: S101 - there were people
    people = counted(explored.participants, "person", "people")
    studies = counted(explored.repeats, "small study", "small studies")
    return Paragraph(
        (
            f"{counted(len(explored.tables['explore']), 'point')}, a tracker and an estimator each; {people} in each of"
            f" {studies}, drawn from seed {settings.seed} and the traits of study.yaml. They are the same people at"
            " every point. With one estimator the same random numbers are used for every tracker, so that trackers are"
            " compared with little noise; each estimator has its own, as in two sessions of one person: otherwise too"
            " few participants would seem enough. Each tracker's latency, noise and rate are stated to the estimators,"
            " as a lab would do. Every number of this report is in results.json; the tables are beside it as CSV"
            " and Parquet, explore_people with one row per session.",
        )
    )

"""The sections of measures: target selection, time, questionnaires and further measures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pipeline.report import figures
from pipeline.report.document.model import (
    Block,
    Column,
    CrossReference,
    Folded,
    Paragraph,
    Section,
    Strong,
    Table,
    Text,
    columns,
)
from pipeline.report.figures.selections import offsets_mm
from pipeline.report.sections import groups, overview
from pipeline.report.sections.comparisons import DIFFERENCE, ESTIMATES, SHIFT_NOTE, difference_cell, methods
from pipeline.report.sections.material import Material, first_of, safe_name
from pipeline.statistics import T
from pipeline.study.measures import MEASURES, measure
from pipeline.study.measures import Section as SectionName
from pipeline.study.statistical_tests import TESTS
from pipeline.tables.table import Row
from pipeline.words.comparison import contrast, shift
from pipeline.words.effect_sizes import effect_size
from pipeline.words.evidence import statistic
from pipeline.words.names import measure_label, short_label
from pipeline.words.numbers import NO_VALUE, digits_beside, fixed_decimals, interval, number, p_value
from pipeline.words.phrases import capitalized, counted, group_sizes, listing
from pipeline.words.sentences import brief_sentence, with_article

_FIXED_FROM = 0.1  # smaller means are shown with significant digits
_PEOPLE_MAX = 40  # a panel each; tables/trials.csv has them all


def selection(material: Material) -> Section | None:
    """Accuracy of target selection (the paper's Fig. 12)."""
    names = _measures_in(material, "selection")
    if not names:
        return None
    drawn = next(name for name in names if "mse" in name)
    text = (
        "How far from the target people selected. MSE is a participant's mean squared distance over trials; RMSE is the"
        " square root of the mean of the participants' MSEs, in the unit of the display."
    )
    blocks: list[Block] = [Paragraph((text,)), *_task(material), *_descriptives(material, "table-selection", names)]
    blocks += _figure_and_tests(material, drawn)
    blocks += _selections(material)
    if material.rows("shown_at_selection"):
        blocks.append(_shown_at_selection(material))
    return Section("selection", "Target selection", tuple(blocks))


def time(material: Material) -> Section | None:
    """Time (the paper's Fig. 13)."""
    names = _measures_in(material, "time")
    if not names:
        return None
    text = (
        "Completion time runs from the start of a session to its last selection; time per trial from the appearance of "
        "a target to its selection."
    )
    blocks: list[Block] = [Paragraph((text,)), *_descriptives(material, "table-time", names)]
    for name in names:
        blocks += _figure_and_tests(material, name)
    return Section("time", "Time", tuple(blocks))


def workload(material: Material) -> Section | None:
    """Questionnaires (the paper's Table 2 and Fig. 14)."""
    scales = _measures_in(material, "ratings")
    if not scales:
        return None
    blocks: list[Block] = []
    for questionnaire in dict.fromkeys(name.partition("/")[0] for name in scales):
        own_scales = [name for name in scales if name.partition("/")[0] == questionnaire]
        blocks += _questionnaire(material, questionnaire, own_scales)
    return Section("workload", "Workload and other ratings", tuple(blocks))


def others(material: Material) -> Section | None:
    """Every measure that has no section of its own."""
    names = _measures_in(material, "others")
    if not names:
        return None
    blocks: list[Block] = [*_descriptives(material, "table-others", names)]
    for name in names:
        blocks += _figure_and_tests(material, name)
    return Section("others", "Further measures", tuple(blocks))


def _measures_in(material: Material, section_name: SectionName) -> list[str]:
    """The study's measures that a section shows: built-in ones first, in their own order, then the others."""
    names = [name for name in material.measured() if measure(name).section == section_name]
    built_in = [name for name in MEASURES if name in names]
    return [*built_in, *(name for name in names if name not in built_in)]


_DESCRIBED = ("n", "Mean", "SD", "Median", "95 % interval of the mean")


def _descriptives(material: Material, table_id: str, names: Sequence[str]) -> Iterator[Block]:
    """The table of means by condition, and that by group where groups of participants are compared."""
    rows = [row for name in names for row in material.rows("descriptives") if row["measure"] == name]
    cells = tuple((measure_label(row["measure"]), row["condition"], *_described(row)) for row in rows)
    caption = "Means over participants; each participant has one value in each condition that they met."
    yield Table(table_id, caption, columns(("Measure", "Condition", *_DESCRIBED), 2), cells, interval_note(rows))
    yield from _by_group(material, table_id, names)


def _by_group(material: Material, table_id: str, names: Sequence[str]) -> Iterator[Block]:
    rows = [row for name in names for row in material.rows("descriptives_by_group") if row["measure"] == name]
    if not rows:
        return
    cells = tuple(
        (measure_label(row["measure"]), f"{row['factor']}: {row['group']}", row["condition"], *_described(row))
        for row in rows
    )
    caption = f"Means by group and condition. {capitalized(group_sizes(rows))}."
    titles = ("Measure", "Group", "Condition", *_DESCRIBED)
    yield Table(f"{table_id}-groups", caption, columns(titles, 3), cells, interval_note(rows))


def _described(row: Row) -> tuple[str, ...]:
    values = (row["mean"], row["sd"], row["median"])
    digits = digits_beside(2, *(value for value in values if value is not None))
    bounds = interval(row["ci_low"], row["ci_high"], digits)
    shown = [NO_VALUE if value is None else _beside(value, row["mean"], digits) for value in values]
    return f"{row['n']}", *shown, bounds


def _beside(value: float, mean: float | None, digits: int) -> str:
    """A value with the decimals of the mean beside it: an SD of 0.0246 beside a mean of 0.93 is 0.02."""
    return number(value, digits) if mean is None or abs(mean) < _FIXED_FROM else fixed_decimals(value, digits)


def interval_note(rows: Sequence[Row]) -> str:
    """How the intervals of these descriptives were computed, where it is not by t alone."""
    of: dict[str, list[str]] = {}
    for row in rows:
        if row["interval"] not in (None, T):
            of.setdefault(row["interval"], []).append(measure_label(row["measure"]))
    exceptions = (f"{listing(list(dict.fromkeys(labels)))}: {method}" for method, labels in of.items())
    return f"Intervals are t intervals; of {'; of '.join(exceptions)}." if of else ""


def _figure_and_tests(material: Material, measure: str) -> list[Block]:
    """A measure's figure and what its tests say."""
    wide = material.participant_means(measure)
    if not wide.notna().any().any():
        return []
    label, shown = measure_label(measure), (wide, measure, material.of_shares(measure))
    blocks: list[Block] = []
    if measure != overview.drawn_measure(material):
        drawn = material.drawn(f"measure-{safe_name(measure)}", figures.paired, *shown)
        # Where some measures are tested, those that are not are what most readers pass over.
        passed_over = material.rows("comparisons") and not material.comparisons_of(measure)
        blocks.append(Folded(f"{label} by participant", (drawn,)) if passed_over else drawn)
    blocks += groups.drawn(material, f"measure-{safe_name(measure)}", [measure])
    for statement in _statements(material.comparisons_of(measure)):
        blocks.append(Paragraph((Strong(f"{label}: "), *statement)))
    return blocks


def _task(material: Material) -> list[Block]:
    """The layout of the task, where study.yaml has one."""
    task = getattr(material.study, "task", None)
    return [] if task is None else [material.drawn("task", figures.task_layout, task)]


def _selections(material: Material) -> list[Block]:
    """Where selections fell about their targets, and each participant's errors trial by trial."""
    study, selections, trials = material.study, material.table("selections"), material.table("trials")
    blocks: list[Block] = []
    if len(study.axes) > 1:
        plane = (study.axes[0], study.axes[1])
        scale = study.display.px_per_mm if study.display is not None and study.display.unit == "px" else None
        if len(offsets_mm(selections, plane)):
            shown = (selections, study.conditions, plane, scale)
            blocks.append(material.drawn("selection-errors", figures.selection_errors, *shown))
    several = trials.groupby(["participant", "condition"])["trial"].nunique().max() if len(trials) else 0
    people = sorted(set(trials["participant"]))
    if several > 1:
        some = trials[trials["participant"].isin(people[:_PEOPLE_MAX])]
        more = first_of(_PEOPLE_MAX, len(people), "participants")
        blocks.append(material.drawn("trials", figures.trials, some, study.conditions, more=more))
    return blocks


def _statements(rows: Sequence[Row]) -> Iterator[Text]:
    """A sentence for each comparison of all conditions, and where the pairs that follow it up are to be found."""
    whole = {
        (row["test"], row["effect"]) for row in rows if row["contrast"] is None and row["statistic_name"] in ("F", "Q")
    }
    follow_ups = []
    for row in rows:
        if row["contrast"] is not None and (row["test"], row["effect"]) in whole:
            follow_ups.append(row)
        else:
            yield (f"{brief_sentence(row)}.",)
    if follow_ups:
        tests = listing(list(dict.fromkeys(with_article(TESTS[row["test"]].label) for row in follow_ups)))
        were = "was" if len(follow_ups) == 1 else "were"
        text = f"{counted(len(follow_ups), 'pair')} {were} compared after {tests}: see the "
        yield (text, CrossReference("table of all comparisons", "comparisons"), ".")


def _questionnaire(material: Material, questionnaire: str, names: list[str]) -> list[Block]:
    scales = [name for name in names if not name.endswith("/total")] or names  # a table may hold the totals alone
    title = measure_label(f"{questionnaire}/x").partition(":")[0]
    wide = {name: material.participant_means(name) for name in scales}
    blocks: list[Block] = [_ratings_table(material, questionnaire, title, names)]
    blocks += _by_group(material, f"table-{safe_name(questionnaire)}", names)
    tested = [row for name in names for row in material.comparisons_of(name)]
    if tested:
        blocks.append(_tests_table(questionnaire, title, tested))
    called = f"ratings-{safe_name(questionnaire)}"
    if len(wide) > 1:  # of a single score the figure of people has the same
        blocks.append(material.drawn(called, figures.workload, wide))
    blocks.append(material.drawn(f"{called}-people", figures.scales, wide))
    blocks += groups.drawn(material, called, scales)
    return blocks


def _ratings_table(material: Material, questionnaire: str, title: str, names: list[str]) -> Table:
    """Mean and SD of every scale, conditions side by side (the paper's Table 2)."""
    conditions = material.study.conditions
    described = {(row["measure"], row["condition"]): row for row in material.rows("descriptives")}
    columns = [Column("Scale", False)]
    for condition in conditions:
        columns += [Column(f"{condition}: mean"), Column("SD"), Column("n")]
    rows = []
    for name in names:
        cells = [short_label(name)]
        for condition in conditions:
            row = described.get((name, condition))
            cells += ["–", "–", "0"] if row is None else [number(row["mean"]), number(row["sd"]), f"{row['n']}"]
        rows.append(tuple(cells))
    with_total = len(names) > 1 and any(name.endswith("/total") for name in names)
    note = "Total: a participant's sum over the scales." if with_total else ""
    return Table(f"table-{safe_name(questionnaire)}", f"{title} ratings by scale.", tuple(columns), tuple(rows), note)


def _tests_table(questionnaire: str, title: str, rows: list[Row]) -> Table:
    estimates = [(title, cell) for title, cell in ESTIMATES if any(cell(row) != NO_VALUE for row in rows)]
    any_shift = any(shift(row) is not None for row in rows)
    if any_shift:
        estimates.insert(0, (DIFFERENCE, difference_cell))
    titles = ("Scale", "Comparison", "n", "Statistic", "p", "p adjusted", "Effect size [95 % interval]")
    cells = tuple(
        (
            short_label(row["measure"]),
            contrast(row),
            f"{row['n']}",
            statistic(row),
            p_value(row["p"]),
            p_value(row["p_adjusted"]),
            effect_size(row) if row["status"] == "ok" else row["status"],
            *(cell(row) for _, cell in estimates),
        )
        for row in rows
    )
    note = f"Methods: {methods(rows)}{f' {SHIFT_NOTE}' if any_shift else ''}"
    caption = f"Tests of the {title} scales."
    if any(row["p_adjusted"] is not None for row in rows):
        caption += " Use the adjusted p: with many tests, some are significant by chance."
    elif len(rows) > 1:
        caption += " With many tests, some are significant by chance; these p values are not adjusted for it."
    return Table(
        f"table-{safe_name(questionnaire)}-tests",
        caption,
        columns([*titles, *(title for title, _ in estimates)], 2),
        cells,
        note,
    )


def _shown_at_selection(material: Material) -> Table:
    """How far from the targets each estimator would have been when people selected."""
    titles = ("Condition", "Estimator", "n", "RMSE (mm)")
    cells = tuple(
        (row["condition"], row["estimator"], f"{row['n']}", number(row["rmse_mm"]))
        for row in material.rows("shown_at_selection")
    )
    return Table(
        "table-shown",
        "What each estimator would have shown at the moments of selection: its distance from the targets. People "
        "aimed with what was displayed, so the displayed estimator has an advantage.",
        columns(titles, 2),
        cells,
        "“recorded” is where the participants selected.",
    )

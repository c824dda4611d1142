"""How well each estimator follows the hand: the paper's Table 1 and Figures 6, 8 and 9 for any study."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import pandas as pd

from pipeline.report import figures
from pipeline.report.document.model import Block, Folded, Paragraph, Section, Strong, Table, columns
from pipeline.report.sections.cautions import contradicted, not_ranked
from pipeline.report.sections.material import Material
from pipeline.sessions.checks.finding import of
from pipeline.sessions.estimators import fusing
from pipeline.sessions.fusion_checks import USED
from pipeline.tables import table as tables
from pipeline.tables.table import Row
from pipeline.words.accuracy_reference import SMOOTHED, reference_phrase
from pipeline.words.estimators import estimator_in_words
from pipeline.words.numbers import NO_VALUE, milliseconds, number, percent
from pipeline.words.phrases import counted

_ROWS_MAX = 40


SMOOTHED_REMARK = (
    " So absolute error and lag cannot be known. Estimates are held against smoothed readings instead: each instant"
    " as the fusion filter sees it from all readings before and after it. What all sensors have wrong together, such as"
    " a latency, does not show, and estimators that resemble the fusion filter come out too well: no estimator can be"
    " called the best from these figures."
)


def section(material: Material) -> Section | None:
    """Fusion accuracy; None for a study of tables alone."""
    if not material.sessions or not material.study.estimators:
        return None
    rows = material.rows("accuracy")
    blocks: list[Block] = [Paragraph(_method(material))]
    if rows:
        if any(row["reference"] == SMOOTHED for row in rows):
            blocks.append(Paragraph((Strong("No reference was recorded."), SMOOTHED_REMARK)))
        blocks.append(_summary_table(material, rows))
        blocks += _over_sessions(material, tables.frame("accuracy", rows))
    else:
        blocks.append(Paragraph((Strong("No accuracy: "), f"errors cannot be given, for {_why_none(material)}.")))
    blocks += _session_figures(material)
    if rows and len(material.sessions) > 1:
        each = _session_table(rows, _without_accelerations(material))
        blocks.append(Folded("Accuracy in each session", (each,)))
    smoothed = any(row["reference"] == SMOOTHED for row in rows)
    return Section("accuracy", f"Fusion beside {SMOOTHED}" if smoothed else "Fusion accuracy", tuple(blocks))


def _why_none(material: Material) -> str:
    """Why no session has accuracy."""
    reasons = [row["reason"] for row in material.rows("exclusions") if row["what"] == "no accuracy" and row["reason"]]
    distinct = list(dict.fromkeys(reasons))
    if distinct:
        return "; ".join(f"{reason} ({counted(reasons.count(reason), 'session')})" for reason in distinct)
    reference = material.study.stream_of_kind("reference")
    return f'no log has a usable "{reference}"' if reference is not None else "no log could be used"


def _without_accelerations(material: Material) -> dict[str, list[str]]:
    """The sessions in which a fusing estimator could use no acceleration, by its name."""
    unused = [row for row in material.rows("checks") if row["status"] == "red" and row["check"].startswith(USED)]
    return {
        name: [row["session"] for row in unused if row["check"] == of(USED, stream)]
        for name, stream in fusing(material.study).items()
    }


def _method(material: Material) -> tuple[str | Strong, ...]:
    with_accelerations = fusing(material.study)
    listed: list[str | Strong] = []
    for name, settings in material.study.estimators.items():
        alone = "" if name in with_accelerations else ", from the tracker alone"
        ahead = settings.parameters.get("ahead_s")
        alone += f", predicting {ahead:g} s ahead" if ahead else ""
        listed += ["; " if listed else "", Strong(name), f" ({estimator_in_words(settings.type)}{alone})"]
    return (
        (
            "Every estimator was run over the same raw streams and asked, at the arrival of each acceleration, where"
            " the hand is at that instant, from what had arrived by then. Estimators: "
        ),
        *listed,
        ".",
    )


def _summary_table(material: Material, rows: list[Row]) -> Table:
    titles = (
        "Estimator",
        "RMSE (mm)",
        "Stated SD (mm)",
        "In 95 % interval",
        "Lag (ms)",
        "Lead, paper's (ms)",
        "Jitter at rest (mm)",
    )
    alone = {name: len(sessions) for name, sessions in _without_accelerations(material).items() if sessions}
    cells = tuple(
        (
            row["estimator"]
            + (
                f" (no acceleration used in {alone[row['estimator']]} of {row['n']})"
                if row["estimator"] in alone
                else ""
            ),
            number(row["rmse_mm"], 2),
            number(row["sd_mm"], 2),
            percent(row["coverage_95"], 0),
            milliseconds(row["lag_s"]),
            milliseconds(row["lead_xcorr_s"]),
            number(row["jitter_mm"], 2),
        )
        for row in material.rows("accuracy_means")
    )
    n, axes = len({row["session"] for row in rows}), len(material.study.axes)
    standard = reference_phrase(row["reference"] for row in rows)
    has_reference = SMOOTHED not in standard
    caption = (
        f"Accuracy of each estimator against {standard}"
        if has_reference
        else f"Distance of each estimator from {standard}"
    )
    reading_help = (
        "Lower RMSE and jitter are better, a lag near zero, and a share near 95 % in the interval."
        if has_reference
        else "No column says which estimator is best."
    )
    unsure = contradicted(material) if has_reference else ""
    where = f"{axes} axes together" if axes > 1 else f"along {material.study.axes[0]}"
    return Table(
        "table-accuracy",
        f"{caption}, means over {counted(n, 'session')} ({where}). {reading_help}{unsure and f' {unsure}'}",
        columns(titles, 1),
        cells,
        f"RMSE: root mean square distance to {standard}. Stated SD: the error the estimator says it makes. In 95 %"
        f" interval: share of instants and axes within 1.96 stated SDs of {standard}. Lag: the shift that fits"
        f" {standard} best, positive = late. Lead: the paper's measure, the peak of the cross-correlation with the"
        " tracker as it arrived, positive = ahead of it; fragile where the hand moves only once or drifts. Jitter: SD"
        f" while the hand is slower than 20 mm/s{of_how_many(rows, 'jitter_mm', n)}."
        f"{_lags_of_fewer(rows, n)}",
    )


def of_how_many(rows: Sequence[Row], figure: str, n: int) -> str:
    """`, in 5 of 8 sessions`, of a figure that only some sessions have; nothing where all have it."""
    counts = Counter(row["estimator"] for row in rows if row[figure] is not None)
    if not counts or all(counts[row["estimator"]] == n for row in rows):
        return ""
    low, high = (pick(counts[row["estimator"]] for row in rows) for pick in (min, max))
    return f", in {low}{f' to {high}' if high > low else ''} of {counted(n, 'session')}"


def _lags_of_fewer(rows: Sequence[Row], n: int) -> str:
    lags = of_how_many(rows, "lag_s", n)
    return f" Lags are means of those that can be told{lags}." if lags else ""


def _session_table(rows: list[Row], alone: Mapping[str, Sequence[str]]) -> Table:
    titles = (
        "Session",
        "Estimator",
        "RMSE (mm)",
        "Stated SD (mm)",
        "In 95 % interval",
        "Lag (ms)",
        "95 % interval (ms)",
        "Jitter (mm)",
    )
    cells = tuple(
        (
            row["session"],
            row["estimator"] + (" (tracker alone)" if row["session"] in alone.get(row["estimator"], ()) else ""),
            number(row["rmse_mm"], 2),
            number(row["sd_mm"], 2),
            percent(row["coverage_95"], 0),
            milliseconds(row["lag_s"]),
            NO_VALUE
            if row["lag_low_s"] is None
            else f"[{milliseconds(row['lag_low_s'])}, {milliseconds(row['lag_high_s'])}]",
            number(row["jitter_mm"], 2),
        )
        for row in rows[:_ROWS_MAX]
    )
    more = (
        f" The first {_ROWS_MAX} of {len(rows)} rows; all are in tables/accuracy.csv." if len(rows) > _ROWS_MAX else ""
    )
    return Table(
        "table-accuracy-sessions",
        f"Accuracy of each estimator in each session, the lag with its 95 % interval.{more}",
        columns(titles, 2),
        cells,
        "Intervals of the lag: moving-block bootstrap, blocks of 0.5 s.",
    )


def _over_sessions(material: Material, rows: pd.DataFrame) -> list[Block]:
    """Error and lag by estimator, one against the other, and the stated SD against what happened."""
    blocks: list[Block] = []
    if material.rows("comparisons"):  # else it stands on the first page
        blocks.append(material.drawn("accuracy", figures.errors, rows, not_ranked(material)))
    if rows["lag_s"].notna().any():
        blocks.append(material.drawn("lag-and-error", figures.lag_and_error, rows, not_ranked(material)))
    counts = material.table("calibration")
    if len(counts):
        blocks.append(material.drawn("calibration", figures.calibration, counts))
    return blocks


def _session_figures(material: Material) -> list[Block]:
    """The paper's figures for one session: the first that can be used."""
    first = (material.used() or [0])[:1]
    excerpts, curves = (material.table_of(name, first) for name in ("excerpts", "lead_curves"))
    blocks: list[Block] = []
    order = tuple(material.study.estimators)
    if len(excerpts):
        blocks.append(material.drawn("streams", figures.streams, excerpts))
    if (excerpts["kind"] == "estimate").any():
        blocks.append(material.drawn("estimates", figures.estimates, excerpts, not_ranked(material), order))
        blocks += _overlaid(material, excerpts)
    if len(curves):
        drawn = material.drawn("lead", figures.lead, curves, _lags_in(material, str(curves["session"].iloc[0])))
        blocks.append(Folded("How far each estimator is ahead of the tracker, by the paper's method", (drawn,)))
    return blocks


def _lags_in(material: Material, session: str) -> dict[str, float]:
    """The lag of each estimator in a session, where it is known."""
    rows = (row for row in material.rows("accuracy") if row["session"] == session and row["lag_s"] is not None)
    return {row["estimator"]: row["lag_s"] for row in rows}


def _overlaid(material: Material, excerpts: pd.DataFrame) -> list[Block]:
    """Fusion on one axis with an estimator of positions alone, of the same type where the study has one."""
    there = list(dict.fromkeys(excerpts.loc[excerpts["kind"] == "estimate", "name"]))
    with_accelerations, estimators = fusing(material.study), material.study.estimators
    fused = [name for name in there if name in with_accelerations]
    positions_only = [name for name in there if name not in with_accelerations]
    alike = [
        (alone, both) for alone in positions_only for both in fused if estimators[alone].type == estimators[both].type
    ]
    pairs = alike or [(alone, both) for alone in positions_only[:1] for both in fused[-1:]]
    return [material.drawn("overlay", figures.overlay, excerpts, *pairs[0], tuple(estimators))] if pairs else []

"""How people were simulated, the reductions over repeated studies, and what holds for real people."""

from __future__ import annotations

from pipeline.report.document.model import Block, Column, Notice, Paragraph, Section, Strong, Table
from pipeline.report.sections.material import Material
from pipeline.statistics.pairs import names_in
from pipeline.study.simulation import SelectionSimulation, Trait
from pipeline.tables.table import Row
from pipeline.words.names import measure_label
from pipeline.words.numbers import number, percent
from pipeline.words.phrases import counted

_MODELS = {
    "intermittent": "minimum-jerk movements that are planned anew after a refractory time (Flash and Hogan 1985)",
    "second_order_lag": "a second-order lag towards the goal (Müller 2017)",
}
_TRAITS = {
    "visual_delay_s": "Eyes behind the display (s)",
    "refractory_s": "Between plans at least (s)",
    "base_time_s": "A movement lasts at least (s)",
    "time_per_sqrt_mm_s": "and per √mm of its length (s)",
    "noise_along_sqrt_s": "Motor noise along the movement, of speed (√s)",
    "noise_across_sqrt_s": "and across it (√s)",
    "expected_lag_share": "Share of the display's lag that is expected",
    "dwell_s": "Target held before a press (s)",
    "press_radius_mm": "and within (mm)",
    "correction_s": "Seen errors are corrected over (s)",
    "margin_mm": "Goals keep from the window's edge (mm)",
    "resume_s": "Pause after a press (s)",
    "tap_s": "A tap lands after (s)",
    "patience_s": "The hold is as lax again after (s)",
    "slow_mm_s": "The hand is still below (mm/s)",
    "dead_zone_mm": "No new plan for less than (mm)",
    "tremor_mm": "Tremor at 8 Hz, SD (mm)",
    "drift_mm": "Drift of the held arm, SD (mm)",
    "natural_frequency_rad_s": "Natural frequency (rad/s)",
    "damping_ratio": "Damping ratio",
}
_OF_LAG_ALONE = ("natural_frequency_rad_s", "damping_ratio")
_OF_PLANS_ALONE = ("refractory_s", "base_time_s", "time_per_sqrt_mm_s", "dead_zone_mm")


def section(material: Material) -> Section | None:
    """The section; None for a study with real people or a scripted hand."""
    settings = material.study.simulation
    if not isinstance(settings, SelectionSimulation):
        return None
    blocks: list[Block] = [Paragraph(_made(settings)), *_gains(material, settings), _care(settings), _traits(settings)]
    return Section("simulation", "The simulated participants", tuple(blocks))


def _made(settings: SelectionSimulation) -> tuple[str | Strong, ...]:
    return (
        f"{counted(settings.participants, 'person', 'people')} were simulated (seed {settings.seed}). ",
        "Each sees only the display, with a delay, knows what their own hand was meant to do, and moves by "
        f"{_MODELS[settings.model]}; motor noise grows with speed. The estimator of each condition ran inside the loop,"
        " at the sensors' own times: what it shows changes how the hand moves.",
    )


def _gains(material: Material, settings: SelectionSimulation) -> list[Block]:
    """Reductions over repeated studies beside the published ones."""
    rows = material.rows("simulated_reductions")
    if not rows:
        return []
    studies = counted(rows[0]["n"], "repeated study", "repeated studies")
    table = Table(
        "table-simulated-reductions",
        f"Reduction from the first condition to the second in {studies} of {settings.participants} other simulated"
        " people each: their mean, and the range that holds 95 % of the studies. A negative reduction is a rise.",
        (
            Column("Measure", False),
            Column("From … to", False),
            Column("Mean"),
            Column("95 % of studies"),
            Column("Published"),
            Column("By", False),
        ),
        tuple(
            (
                measure_label(row["measure"]),
                _from_to(row),
                percent(row["reduction"]),
                f"[{percent(row['ci_low'])}, {percent(row['ci_high'])}]",
                percent(row["published_reduction"]),
                row["source"] or "",
            )
            for row in rows
        ),
    )
    texts = tuple((_beside(row),) for row in rows if row["published_reduction"] is not None)
    return [*(Paragraph(text) for text in texts), table]


def _beside(row: Row) -> str:
    """The published reduction and the simulated ones, in a sentence."""
    if row["ci_low"] <= row["published_reduction"] <= row["ci_high"]:
        verdict = "lies within what 95 % of the simulated studies give"
    else:
        side = "less" if row["published_reduction"] < row["ci_low"] else "more"
        verdict = f"is {side} than 95 % of the simulated studies give"
    label = measure_label(row["measure"])
    return (
        f"{label}: the published reduction of {percent(row['published_reduction'])} ({row['source']}) {verdict} "
        f"({percent(row['reduction'])} on average, from {_from_to(row)})."
    )


def _from_to(row: Row) -> str:
    """`kinect to fusion`."""
    return " to ".join(names_in(row["contrast"]) or (row["contrast"],))


def _care(settings: SelectionSimulation) -> Notice:
    texts: list[tuple[str, ...]] = [
        (
            "The direction and rough size of the effects of lag and jitter can be taken from this. Seconds,"
            " millimetres, ratings and the number of people a study needs cannot: they depend on a model of people.",
        ),
        (
            "An error is displayed less target position. A constant offset of the estimate cancels, since people steer"
            " what they see; so errors here are smaller than in a study where the display itself is offset.",
        ),
    ]
    if settings.workload is not None:
        texts.append(
            (
                "Ratings come from a stated response model: each scale rises by so much for each doubling of time,"
                " error or corrections, with a person's own level and chance added. They show only what was assumed.",
            )
        )
    return Notice("What may be said of real people", tuple(texts))


def _traits(settings: SelectionSimulation) -> Table:
    """Every trait in use, with who says so."""
    unused = _OF_LAG_ALONE if settings.model == "intermittent" else _OF_PLANS_ALONE
    rows = []
    for name, label in _TRAITS.items():
        trait: Trait = getattr(settings.traits, name)
        if name not in unused:
            rows.append((label, number(trait.mean, 4).rstrip("0").rstrip("."), percent(trait.cv, 0), trait.source))
    return Table(
        "table-traits",
        "Traits: mean, how far people differ (coefficient of variation), and the source. None was fitted to the"
        " published results that the study is compared with.",
        (Column("Trait", False), Column("Mean"), Column("CV"), Column("Source", False)),
        tuple(rows),
    )

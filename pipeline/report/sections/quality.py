"""The quality of the logs, session by session, and everything that is missing or was excluded."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from pipeline.report import figures, traffic_lights
from pipeline.report.document.model import Block, Column, Folded, Paragraph, Section, Strong, Table, columns
from pipeline.report.sections import checks, recorded_live, sensors_found, timeline
from pipeline.report.sections.material import Material
from pipeline.report.sections.without_exclusions import without_exclusions
from pipeline.report.traffic_lights import FACTS, LIGHTS, SYMBOLS, Judged, light_of
from pipeline.study.statistical_tests import TESTS
from pipeline.tables.table import Row
from pipeline.words.names import measure_label
from pipeline.words.numbers import NO_VALUE, number
from pipeline.words.phrases import counted, listing

_ROWS_MAX = 40  # a page stays readable; tables/quality.csv has them all


def section(material: Material) -> Section:
    """Data quality and exclusions."""
    blocks: list[Block] = []
    if material.rows("quality"):
        blocks += _lights(material)
    blocks += checks.blocks(material)
    if material.rows("quality"):
        blocks.append(Folded("Each stream as it was recorded", (_quality_table(material),)))
        arrivals = timeline.figure(material)
        if arrivals is not None:
            blocks.append(Folded("What arrived when", (arrivals,)))
        if material.rows("sensor_noise"):
            blocks += _noise(material)
        elif material.rows("accuracy"):
            blocks.append(
                Paragraph(
                    ("No session holds a still stretch of a second or more, so the sensors' noise cannot be measured.",)
                )
            )
    if any(row["in_log"] == 0 or row["carried"] or row["left_out"] for row in material.rows("phones")):
        blocks.append(_orientation_table(material))
    if any(row["calibrated_until_s"] is not None for row in material.rows("phones")):
        blocks.append(_mounting_table(material))
    blocks += sensors_found.folded(material)
    blocks += recorded_live.blocks(material)
    agreement = material.rows("replay_agreement")
    if agreement:
        blocks.append(Folded(_agreement_summary(agreement), (_agreement_table(material),), in_annex=False))
    blocks += [*_exclusions(material), *without_exclusions(material)]
    return Section("quality", "Data quality and exclusions", tuple(blocks))


def _lights(material: Material) -> list[Block]:
    """How many sessions are green, amber and red, and what decides it in each."""
    by_session: dict[str, list[Judged]] = {}
    rows = (material.rows(name) for name in ("quality", "replay_agreement", "checks"))
    judged = traffic_lights.judged(material.study, *rows)
    for figure in judged:
        by_session.setdefault(figure.session, []).append(figure)
    lights = [light_of(figures) for figures in by_session.values()]
    shares = [f"{lights.count(light)} {SYMBOLS[light]} {light}" for light in LIGHTS[1:]]
    facts = [fact for fact in FACTS if any(figure.fact == fact for figure in judged)]
    ordered = sorted(by_session.items(), key=lambda item: -LIGHTS.index(light_of(item[1])))
    cells = tuple((session, *_session_lights(figures, facts)) for session, figures in ordered[:_ROWS_MAX])
    more = f" The worst {_ROWS_MAX} of {len(ordered)}." if len(ordered) > _ROWS_MAX else ""
    limits = traffic_lights.limits_text(material.study.quality_limits)
    table = Table(
        "table-lights",
        f"Each session's quality at a glance, the worst first: its light, and the worst of each kind of figure.{more}",
        columns(("Session", "Light", *facts), len(facts) + 2),
        cells,
        f"Amber from these limits on (red from those in brackets): {limits}. A rate is compared with the one that"
        " study.yaml states, or with the median of three or more sessions; quality_limits in study.yaml moves the"
        " limits. Checks: whether the readings fit each other and study.yaml; see the table of checks. No session is"
        " excluded because of its light.",
    )
    text = f"{counted(len(by_session), 'session')}: {listing(shares)}.{_missing_sessions(material)}"
    all_green = set(lights) <= {"green", "not judged"}
    return [Paragraph((Strong("Quality: "), text)), Folded("Each session's lights", (table,)) if all_green else table]


def _session_lights(figures: Sequence[Judged], facts: Sequence[str]) -> tuple[str, ...]:
    """A session's light, and the worst figure of each fact."""
    light = light_of(figures)
    of_fact = [_fact_light([figure for figure in figures if figure.fact == fact]) for fact in facts]
    return f"{SYMBOLS[light]} {light}", *of_fact


def _fact_light(figures: Sequence[Judged]) -> str:
    """The worst of a fact's figures, and how many others are as bad."""
    worst = traffic_lights.worst(figures)
    if worst is None:
        return NO_VALUE
    others = sum(figure.light == worst.light for figure in figures) - 1
    return worst.text + (f" and {others} more" if others and worst.light in ("amber", "red") else "")


def _missing_sessions(material: Material) -> str:
    """How many sessions were set aside or read only in part."""
    what = [row["what"] for row in material.rows("exclusions")]
    wording = (("session set aside", "set aside"), ("session read in part", "read in part"))
    parts = [f"{counted(what.count(name), 'session')} {words}" for name, words in wording if name in what]
    return f" In addition, {listing(parts)}; the table of exclusions says why." if parts else ""


def _quality_table(material: Material) -> Table:
    rows = material.rows("quality")
    titles = (
        "Session",
        "Stream",
        "Messages",
        "Lost",
        "Rate (Hz)",
        "Longest gap (ms)",
        "Jitter (ms)",
        "Out of order",
        "Delay in log (ms)",
        "Note",
    )
    cells = tuple(
        (
            row["session"],
            row["stream"],
            f"{row['messages_read']}",
            "unknown" if row["messages_lost"] is None else f"{row['messages_lost']}",
            number(row["rate_hz"], 1),
            _milliseconds(row["gap_max_s"]),
            number(row["jitter_ms"], 1) if row["jitter_ms"] is None or row["jitter_ms"] >= 0.05 else "0.0",
            NO_VALUE if row["out_of_order"] is None else f"{row['out_of_order']}",
            _milliseconds(row["latency_s"]),
            row["note"] or "",
        )
        for row in rows[:_ROWS_MAX]
    )
    shown = len(titles) if any(row[-1] for row in cells) else len(titles) - 1  # no column without a note in it
    more = (
        f" The first {_ROWS_MAX} of {len(rows)} rows; all are in tables/quality.csv." if len(rows) > _ROWS_MAX else ""
    )
    return Table(
        "table-quality",
        "Each sensor stream as it was recorded. Look for lost messages, long gaps and rates off their usual value."
        + more,
        tuple(Column(title, title not in ("Session", "Stream", "Note")) for title in titles[:shown]),
        tuple(row[:shown] for row in cells),
        "Rate: messages a second of the stream's own clock. Jitter: SD of the time between arrivals, gaps left out. "
        "Delay in log: median of arrival minus stamp; a tracker that stamps on delivery shows none.",
    )


def _milliseconds(seconds: float | None) -> str:
    return NO_VALUE if seconds is None else number(1000 * seconds, 0 if seconds >= 0.01 else 1)


def _orientation_table(material: Material) -> Table:
    """Where the orientation of each acceleration came from, shown if not all of them were logged."""
    cells = tuple(
        (row["session"], row["stream"], *(f"{row[key]}" for key in ("in_log", "carried", "found", "left_out")))
        for row in material.rows("phones")[:_ROWS_MAX]
    )
    titles = ("Session", "Stream", "In the log", "Carried on", "Found", "Left out")
    return Table(
        "orientations",
        "Where the orientation of each acceleration came from. Carried on: by the gyroscope from the last known one,"
        " for up to a second. Found: tilt by gyroscope and accelerometer, heading from how the tracker's positions"
        " move. Left out: not known, so the acceleration was not used.",
        columns(titles, 2),
        cells,
    )


def _mounting_table(material: Material) -> Table:
    """What was learned about each phone's mounting: rotation and lever arm."""
    learned = [row for row in material.rows("phones") if row["calibrated_until_s"] is not None]

    def three(row: Row, key: str, unit: str, digits: int) -> str:
        pairs = ((row[f"{key}_{a}_{unit}"], row[f"{key}_sd_{a}_{unit}"]) for a in "xyz")
        return ", ".join(f"{value:.{digits}f} ± {1.96 * sd:.{digits}f}" for value, sd in pairs).replace("-", "−")

    cells = tuple(
        (
            row["session"],
            row["stream"],
            number(row["calibrated_until_s"], 1),
            three(row, "mounting", "deg", 1),
            three(row, "lever_arm", "mm", 0),
        )
        for row in learned[:_ROWS_MAX]
    )
    titles = ("Session", "Stream", "Learned until (s)", "Mounting error x, y, z (°)", "Lever arm x, y, z (mm)")
    return Table(
        "mountings",
        "How each accelerometer sits on the body that the tracker sees, learned from the beginning of the session and"
        " used from then on: the small rotation of its axes, and the way from it to the point that is seen, with 95 %"
        " intervals.",
        columns(titles, len(titles)),
        cells,
    )


def _noise(material: Material) -> list[Block]:
    """The sensors' noise while nothing moved, beside what study.yaml states."""
    rows = pd.DataFrame(material.rows("sensor_noise"))
    names = [name for name in material.study.streams if name in set(rows["stream"])]
    units = pd.Series({name: str(rows.loc[rows["stream"] == name, "unit"].iloc[0]) for name in names})
    cells = tuple(
        (
            row["session"],
            row["stream"],
            row["unit"],
            f"{number(row['begin_s'], 1)} to {number(row['end_s'], 1)}",
            f"{row['n']}",
            number(row["sd"], 1),
            number(row["stated_sd"], 1),
        )
        for row in material.rows("sensor_noise")[:_ROWS_MAX]
    )
    titles = (
        "Session",
        "Stream",
        "Unit",
        "Still from … to (s)",
        "Readings",
        "SD measured",
        "SD in study.yaml",
    )
    table = Table(
        "table-noise",
        "Sensor noise in each session's longest still stretch, beside the noise that the estimators assume.",
        columns(titles, 3),
        cells,
        "Still: the reference moves slower than 20 mm/s."
        if material.study.stream_of_kind("reference")
        else "Still: the accelerations vary little.",
    )
    drawn = material.drawn("sensor-noise", figures.noise, _residuals(material, names), units)
    return [drawn, Folded("Sensor noise in each session", (table,), in_annex=False)]


def _residuals(material: Material, names: Sequence[str]) -> pd.DataFrame:
    """Residuals by stream, of all sessions.

    There may be millions, so they are read session by session and names are kept as numbers (categoricals).
    """
    parts = []
    for place in range(len(material.sessions)):
        rows = material.table_of("noise_residuals", [place])[["stream", "residual"]]
        parts.append(rows.assign(stream=rows["stream"].astype(pd.CategoricalDtype(list(names)))))
    return pd.concat(parts)


def _agreement_summary(rows: Sequence[Row]) -> str:
    largest = max((row["max_mm"] for row in rows if row["max_mm"] is not None), default=None)
    of = f"in {counted(len(rows), 'session')}"
    if largest is None:
        return f"What was displayed cannot be compared with a replay {of}"
    return f"What was displayed is within {number(largest, 3)} mm of the replay {of}"


def _agreement_table(material: Material) -> Table:
    return Table(
        "table-replay",
        "How far what was displayed is from what the estimator gives when it is run again over the same log. Zero, up "
        "to rounding, means that the log shows what it says it showed.",
        columns(("Session", "Estimator", "Samples", "Largest (mm)", "Root mean square (mm)"), 2),
        tuple(
            (
                row["session"],
                row["estimator"],
                f"{row['n']}",
                number(row["max_mm"], 3),
                number(row["rms_mm"], 3),
            )
            for row in material.rows("replay_agreement")[:_ROWS_MAX]
        ),
    )


def _not_in_exclusions(material: Material) -> list[str]:
    """What is missing from the report although the table of exclusions has no row for it."""
    unused = sum(row["left_out"] for row in material.rows("phones"))
    undefined = sum(row["status"] != "ok" for row in material.rows("comparisons"))
    lost = [row for row in material.rows("quality") if row["messages_lost"] is None or row["messages_lost"]]
    causes = (
        (unused, f"{counted(unused, 'acceleration')} of unknown orientation could not be used"),
        (undefined, f"{counted(undefined, 'comparison')} cannot be computed"),
        (len(lost), f"messages were lost in {counted(len(lost), 'stream')}, or nobody can say whether any were"),
    )
    return [text for count, text in causes if count]


def _exclusions(material: Material) -> list[Block]:
    rows = material.rows("exclusions")
    if not rows:
        missing = _not_in_exclusions(material)
        text = "Nothing was left out: every session, participant and value of the study is in this report."
        if missing:
            text = f"No session, participant or value was left out as a whole; but {listing(missing)}."
        return [Paragraph((text,))]
    titles = ("Participant", "Condition", "Session", "Measure", "What", "Reason")
    cells = tuple(
        (
            row["participant"] or NO_VALUE,
            row["condition"] or NO_VALUE,
            row["session"] or NO_VALUE,
            measure_label(row["measure"]) if row["measure"] else "all",
            row["what"],
            _reason(row["reason"] or ""),
        )
        for row in rows[:_ROWS_MAX]
    )
    more = f" The first {_ROWS_MAX} of {len(rows)}; all are in tables/exclusions.csv." if len(rows) > _ROWS_MAX else ""
    return [
        Table(
            "table-exclusions",
            f"Everything that is missing or was left out, and why ({counted(len(rows), 'entry', 'entries')}).{more}",
            columns(titles, len(titles)),
            cells,
        )
    ]


def _reason(reason: str) -> str:
    """The reason, with a test that begins it by its label: `paired t: no value in b`."""
    name, colon, rest = reason.partition(": ")
    return f"{TESTS[name].label}{colon}{rest}" if colon and name in TESTS else reason

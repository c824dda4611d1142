"""What `power` prints and writes: the table, what each of its figures means, and the curve."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline.statistics.counterbalancing import williams_design
from pipeline.statistics.power import Design
from pipeline.statistics.power_simulation import Share
from pipeline.statistics.sample_size import Needed, SampleSize
from pipeline.words.numbers import fraction, number

FILES = ("power.svg", "power.csv", "power.json")
_NAMES = {
    "t_paired": "Paired t test",
    "wilcoxon": "Exact Wilcoxon signed-rank test",
    "rm_anova": "Repeated-measures ANOVA",
}
_FORMULAS = {"t_paired": "noncentral t", "rm_anova": "noncentral F"}
_SERIES = {"power_closed_form": "closed form", "power_simulated": "simulated", "power_corrected": "Greenhouse-Geisser"}
_MEANING = {
    "effect": "which effect of the design",
    "effect_size": "its size: d, d_z, f, or the bound of an equivalence, which of them the object `effect` says",
    "participants": "complete participants in all, without those who drop out",
    "in_first_group": "how many of them are in the first group; all where there are no groups",
    "power_closed_form": "chance that p is below alpha if the effect is as stated; null where there is no formula",
    "power_simulated": "the same, as a share of simulated studies; low and high: its Clopper-Pearson 95 % interval",
    "power_corrected": "the same of p corrected for sphericity (Greenhouse-Geisser), by which a report judges more than"
    " two conditions",
}
Record = dict[str, Any]


def record(effect: str, effect_size: float, participants: int, in_first_group: int, **powers: Any) -> Record:
    """A row of power.csv and power.json; what is not given of the powers does not apply and is None."""
    columns = [key for key in _MEANING if key.startswith("power_")]
    columns = [
        name
        for key in columns
        for name in ([key] if key == "power_closed_form" else [key, f"{key}_low", f"{key}_high"])
    ]
    row = {"effect": effect, "effect_size": effect_size, "participants": participants, "in_first_group": in_first_group}
    return {**row, **{column: powers.get(column) for column in columns}}


def simulated(column: str, shares: Share | None) -> Record:
    """The share of simulated studies, and its interval, under this column's name."""
    low, high = (None, None) if shares is None else shares.interval()
    return {column: shares and shares.power, f"{column}_low": low, f"{column}_high": high}


def records(design: Design, planned: SampleSize) -> list[Record]:
    """One row per number of participants; the columns are always the same, None where they do not apply."""
    size = design.f if design.test == "rm_anova" else design.dz
    return [
        record(
            "condition",
            size,
            row.n,
            row.n,
            power_closed_form=row.closed_form,
            **simulated("power_simulated", row.simulated.own),
            **simulated("power_corrected", row.simulated.corrected),
        )
        for row in planned.rows
    ]


def heading(design: Design, power: float) -> str:
    """What is planned."""
    return f"{_named(design)}, alpha = {design.alpha:g}, for a power of {power:g}"


def _named(design: Design) -> str:
    kind = f" of {design.conditions} conditions" if design.test == "rm_anova" else ", two-sided"
    return f"{_NAMES[design.test]}{kind}"


def table(rows: Sequence[Record]) -> tuple[list[str], list[list[str]]]:
    """Header and cells for people, without the columns that do not apply."""
    header, lines = ["participants"], [[str(row["participants"])] for row in rows]
    for column in _present(rows):
        header += [_SERIES[column], *(["95 % interval"] if f"{column}_low" in rows[0] else [])]
        for line, row in zip(lines, rows, strict=True):
            line.append(fraction(row[column]))
            if f"{column}_low" in row:
                line.append(f"[{fraction(row[f'{column}_low'])}, {fraction(row[f'{column}_high'])}]")
    return header, lines


def _present(rows: Sequence[Record]) -> list[str]:
    return [column for column in _SERIES if rows[0][column] is not None]


def answer(design: Design, studies: int, seed: int, planned: SampleSize) -> list[str]:
    """How many participants by each way of computing it, and what that rests on."""
    lines = []
    if planned.closed_form is not None:
        lines.append(f"Closed form ({_FORMULAS[design.test]}): {planned.closed_form} participants.")
    lines.append(f"Simulation ({studies} studies per row, seed {seed}): {_within_error(planned.simulated)}.")
    if planned.corrected is not None:
        lines.append(f"  corrected by Greenhouse-Geisser, as a report judges: {_within_error(planned.corrected)}.")
    lines.append(
        f"Power is the chance that p < {design.alpha:g} if the effect is as stated. Add those you expect to drop out."
    )
    lines.append(f"Assumed: {_assumed(design)}.")
    sequences, judged = len(williams_design(design.conditions)), planned.judged_by
    if judged is not None:
        even = -(-judged // sequences) * sequences
        lines.append(
            f"Counterbalancing (steadyhand plan) takes {sequences} sequences, which {even} participants share evenly."
        )
    return lines


def _within_error(needed: Needed) -> str:
    if needed.n is None:
        return "more participants than --max-n"
    low = needed.low or needed.n
    if low == needed.high:
        return f"{needed.n} participants"
    if needed.high is None:
        return f"{needed.n} participants, at least {low}; more --simulations would bound it"
    return f"{needed.n} participants, {low} to {needed.high} within the simulation's error"


def _assumed(design: Design) -> str:
    """What the simulated studies assume."""
    if design.test == "rm_anova":
        spherical = ", so that sphericity holds" if design.conditions > 2 else ""
        return f"normal values, equally spread in every condition, equally correlated between any two{spherical}"
    if design.test == "wilcoxon":
        return "normal differences without ties; ratings on a coarse scale tie, and take more participants"
    return "normal differences"


def write(folder: Path, design: Design, settings: Mapping[str, Any], planned: SampleSize) -> None:
    """The table as CSV and JSON, and the curve as SVG."""
    rows = records(design, planned)
    effect = {"d": design.difference, "d_z": design.dz, "f": design.f, "correlation": design.correlation}
    needed = {
        "closed_form": planned.closed_form,
        "simulated": vars(planned.simulated),
        "corrected": planned.corrected and vars(planned.corrected),
    }
    write_files(folder, settings, effect, needed, rows)
    _draw(folder / "power.svg", design, rows, planned, settings["power"])


def write_files(
    folder: Path,
    settings: Mapping[str, Any],
    effect: Mapping[str, Any],
    needed: Mapping[str, Any],
    rows: Sequence[Record],
) -> None:
    """power.csv and power.json."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "power.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(record("", 0, 0, 0)), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    content = {
        "settings": dict(settings),
        "effect": dict(effect),
        "needed": dict(needed),
        "meaning": _MEANING,
        "rows": list(rows),
    }
    text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    (folder / "power.json").write_text(text, encoding="utf-8")


def _draw(path: Path, design: Design, rows: Sequence[Record], planned: SampleSize, target: float) -> None:
    import pandas as pd

    from pipeline.report import figures

    needed = {
        "power_closed_form": planned.closed_form,
        "power_simulated": planned.simulated.n,
        "power_corrected": planned.corrected and planned.corrected.n,
    }
    names = {
        "power_closed_form": f"closed form ({_FORMULAS.get(design.test)})",
        "power_simulated": "simulated (95 % interval)",
        "power_corrected": "simulated, Greenhouse-Geisser",
    }
    series = {column: f"{names[column]}, n = {needed[column] or '?'}" for column in _present(rows)}
    effect = f"f = {number(design.f)}" if design.test == "rm_anova" else f"d_z = {number(design.dz)}"
    labels = figures.Labels(f"{_named(design)}: {effect}", f"Power (chance that p < {design.alpha:g})")
    shown = pd.DataFrame(rows).dropna(axis="columns", how="all")
    figures.draw(figures.power, path, shown, series, target, planned.judged_by, labels)


def draw_curves(path: Path, title: str, alpha: float, rows: Sequence[Record], target: float) -> None:
    """power.svg with a curve for each effect in the rows, which are all of the same numbers of participants."""
    import pandas as pd

    from pipeline.report import figures

    closed = rows[0]["power_closed_form"] is not None
    ends = {"": "power_closed_form"} if closed else {end: f"power_simulated{end}" for end in ("", "_low", "_high")}
    table: dict[int, Record] = {}
    for row in rows:
        at = table.setdefault(row["participants"], {"participants": row["participants"]})
        at |= {f"{row['effect']}{end}": row[column] for end, column in ends.items()}
    series = {name: name for name in dict.fromkeys(row["effect"] for row in rows)}
    labels = figures.Labels(title, f"Power (chance that p < {alpha:g})")
    figures.draw(figures.power, path, pd.DataFrame(list(table.values())), series, target, None, labels)

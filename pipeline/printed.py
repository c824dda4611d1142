"""A paper's printed figures beside the computed ones, and printed figures that cannot all be true."""

from __future__ import annotations

from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd

from pipeline import tables
from pipeline.errors import PipelineError
from pipeline.study import Frozen, parse, read_yaml

Row = dict[str, Any]
_LARGEST_EXPONENT = 100


class Figure(Frozen):
    """One printed figure and the row and column that should give it. `times` turns a mean into a total or a percent."""

    what: str
    printed: str
    table: Literal["descriptives", "comparisons"]
    measure: str
    column: str
    condition: str | None = None
    test: str | None = None
    times: float = 1.0


class Total(Frozen):
    """A printed total of n whole-number ratings over several scales, and the printed means of those scales."""

    what: str
    printed: str
    n: int
    means: tuple[str, ...]


class Claim(Frozen):
    """A printed p value and what the text says of it."""

    what: str
    p: str
    significant: bool


class Printed(Frozen):
    """printed.yaml: what a publication prints of the study."""

    source: str
    figures: tuple[Figure, ...] = ()
    totals: tuple[Total, ...] = ()
    claims: tuple[Claim, ...] = ()


def compare_printed(path: Path, descriptives: pd.DataFrame, comparisons: pd.DataFrame, alpha: float) -> pd.DataFrame:
    """The table `printed`: each figure with its computed value, then each total and claim by itself.

    Verdicts: agrees, differs, undefined; contradiction or consistent where printed figures are held against
    each other.
    """
    printed = parse(Printed, read_yaml(path), path)
    found = {"descriptives": descriptives, "comparisons": comparisons}
    rows = [_figure(path, figure, found[figure.table]) for figure in printed.figures]
    rows += [_total(path, total) for total in printed.totals]
    rows += [_claim(path, claim, alpha) for claim in printed.claims]
    return tables.frame("printed", [{**row, "source": printed.source} for row in rows])


def _decimal(path: Path, text: str) -> Decimal:
    try:
        value = Decimal(text)
        if value.is_finite() and abs(value.adjusted()) < _LARGEST_EXPONENT:
            return value
        raise InvalidOperation
    except InvalidOperation:
        raise PipelineError(f'{path}: "{text}" should be a number, in quotes and with the digits as printed') from None


def _half_unit(value: Decimal) -> Decimal:
    """Half a unit of the last printed digit: how far the unrounded figure may be from it."""
    exponent = value.as_tuple().exponent
    return Decimal((0, (5,), int(exponent) - 1))


def as_printed(value: float, printed: Decimal) -> str:
    """A computed value with as many digits as the printed one."""
    exponent = int(printed.as_tuple().exponent)
    if exponent <= 0:
        return f"{value:.{-exponent}f}"
    return f"{value:.{len(printed.as_tuple().digits) - 1}e}".replace("e+0", "e")


def _figure(path: Path, figure: Figure, table: pd.DataFrame) -> Row:
    printed = _decimal(path, figure.printed)
    value = _computed(path, figure, table) * figure.times
    row: Row = {"what": figure.what, "printed": figure.printed}
    if not np.isfinite(value):
        return row | {"computed": "undefined", "verdict": "undefined"}
    agrees = abs(Decimal(value) - printed) <= _half_unit(printed) * Decimal("1.000001")
    return row | {
        "computed": as_printed(value, printed),
        "computed_value": value,
        "verdict": "agrees" if agrees else "differs",
    }


def _computed(path: Path, figure: Figure, table: pd.DataFrame) -> float:
    """The figure's value in the table; a reduction of a descriptive is that of its two conditions' means."""
    rows = table[table["measure"] == figure.measure]
    if figure.table == "descriptives" and figure.column == "reduction":
        means = rows["mean"].to_numpy(np.float64)
        if len(means) != 2:
            raise PipelineError(f'{path}: "{figure.what}": a reduction needs two conditions, found {len(means)}')
        return float(1 - means[1] / means[0]) if means[0] != 0 else np.nan
    for column in ("condition", "test"):
        wanted = getattr(figure, column)
        if wanted is not None:
            rows = rows[rows[column] == wanted]
    if "contrast" in rows and rows["contrast"].isna().any():
        rows = rows[rows["contrast"].isna()]  # without what follows them up
    if len(rows) != 1 or figure.column not in rows or rows[figure.column].dtype.kind not in "fi":
        raise PipelineError(
            f'{path}: "{figure.what}" fits {len(rows)} rows of {figure.table} with a column "{figure.column}"; it must '
            "fit one: check measure, condition, test and column"
        )
    value = rows.iloc[0][figure.column]
    return np.nan if pd.isna(value) else float(value)


def _total(path: Path, total: Total) -> Row:
    """Each scale's sum is a whole number that its printed mean allows; their total must be the printed one."""
    low = high = 0
    for text in total.means:
        mean = _decimal(path, text)
        half = _half_unit(mean)
        low += int(np.ceil(float((mean - half) * total.n) - 1e-9))
        high += int(np.floor(float((mean + half) * total.n) + 1e-9))
    fits = low <= _decimal(path, total.printed) <= high
    allowed = str(low) if low == high else f"{low} to {high}"
    return {
        "what": total.what,
        "printed": total.printed,
        "computed": allowed,
        "computed_value": float(low) if low == high else None,
        "verdict": "consistent" if fits else "contradiction",
        "explanation": (
            f"the printed means of {len(total.means)} scales add up to {allowed} over {total.n} participants"
        ),
    }


def _claim(path: Path, claim: Claim, alpha: float) -> Row:
    below = _decimal(path, claim.p) < Decimal(str(alpha))
    said = "significant" if claim.significant else "not significant"
    return {
        "what": claim.what,
        "printed": f"p = {claim.p}, called {said}",
        "computed": "significant" if below else "not significant",
        "verdict": "consistent" if below == claim.significant else "contradiction",
        "explanation": f"p = {claim.p} is {'below' if below else 'not below'} the level of {alpha:g}",
    }

"""Fitts' law in each condition: movement time as a line over the index of difficulty. Rows of `fitts`.

A block is all movements to targets of one width over one distance, as a ring has them (within 10 %). Each participant
with five movements or more in a block counts with one point, the mean over which is the block's point in its condition;
the line goes through the points of the blocks (Soukoreff and MacKenzie 2004). Nominal difficulty comes from
the targets as they were shown, effective difficulty from where people selected.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.sessions.movements import SEQUENCE_MIN, sequences
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.fitts import Blocks, effective, fitted, index_of_difficulty
from pipeline.tables.table import Row
from pipeline.words.numbers import MINUS

NOMINAL, EFFECTIVE = "nominal", "effective"
BLOCKS_MIN = 3
R_SQUARED_MIN = 0.8  # our own limit: lines through means over participants are usually above .9
INTERCEPT_MIN_S = -0.2  # our own limit: no movement takes less than no time, and the rest is for noise
_FIGURES = ["amplitude_mm", "moved_mm", "along_mm", "duration_s"]
_PERSON = ["condition", "block", "participant"]


@dataclass(frozen=True)
class Fitts:
    """The rows of `fitts` and of `fitts_points`."""

    lines: list[Row]
    points: list[Row]


def fitts_law(movements: pd.DataFrame, conditions: Sequence[str]) -> Fitts:
    """The lines and points of each condition; none where nobody made five movements of one distance and width.

    `movements` is the table of the study.
    """
    if movements.empty:
        return Fitts([], [])
    each = _of_people(_in_blocks(movements))
    lines: list[Row] = []
    points: list[Row] = []
    for condition in conditions:
        own = each[each["condition"] == condition]
        for basis in (NOMINAL, EFFECTIVE):
            known = own[own[f"{basis}_bits"].notna()]
            if len(known):
                shown = list(_points(known, condition, basis))
                lines.append(_line(known, shown, condition, basis))
                points += shown
    return Fitts(lines, points)


def _in_blocks(movements: pd.DataFrame) -> pd.DataFrame:
    """The movements that are known in full, with their block's number and its nominal distance."""
    finite = np.isfinite(movements[_FIGURES].to_numpy(np.float64)).all(axis=1)
    known = movements[finite & (movements["duration_s"] > 0).to_numpy()]
    amplitude, width = (known[name].to_numpy(np.float64) for name in ("amplitude_mm", "width_mm"))
    block, nominal_mm = np.full(len(known), -1), np.full(len(known), np.nan)
    for number, rows in enumerate(sequences(amplitude, width)):
        block[rows], nominal_mm[rows] = number, amplitude[rows].mean()
    in_block: pd.DataFrame = known.assign(block=block, nominal_mm=nominal_mm)[block >= 0]
    return in_block


def _of_people(movements: pd.DataFrame) -> pd.DataFrame:
    """One row per condition, block and participant with enough movements: distance, width, difficulties and time."""
    rows = []
    for (condition, block, participant), own in movements.groupby(_PERSON, sort=True):
        if len(own) < SEQUENCE_MIN:
            continue
        moved, along, time_s = (own[name].to_numpy(np.float64) for name in ("moved_mm", "along_mm", "duration_s"))
        amplitude, width = own[["nominal_mm", "width_mm"]].iloc[[0]].to_numpy(np.float64).T
        found = effective(moved, along, time_s, [""] * len(own))
        rows.append(
            {
                "condition": condition,
                "block": block,
                "participant": participant,
                "movements": len(own),
                "time_s": float(time_s.mean()),
                "nominal_mm": amplitude[0],
                "nominal_width_mm": width[0],
                "nominal_bits": index_of_difficulty(amplitude, width)[0],
                "effective_mm": _only(found.amplitude),
                "effective_width_mm": _only(found.width),
                "effective_bits": _only(found.difficulty),
            }
        )
    columns = [*_PERSON, "movements", "time_s"]
    columns += [f"{basis}_{name}" for basis in (NOMINAL, EFFECTIVE) for name in ("mm", "width_mm", "bits")]
    return pd.DataFrame(rows, columns=columns)


def _only(values: FloatArray) -> float:
    return float(values[0]) if len(values) else np.nan


def _points(people: pd.DataFrame, condition: str, basis: str) -> Iterator[Row]:
    """The means over participants of each block."""
    for _, own in people.groupby("block", sort=True):
        amplitude, width = own["nominal_mm"].iloc[0], own["nominal_width_mm"].iloc[0]
        of_width = "" if np.isnan(width) else f", W {width:.4g} mm"
        yield {
            "condition": condition,
            "difficulty": basis,
            "block": f"A {amplitude:.4g} mm{of_width}",
            "n": len(own),
            "movements": int(own["movements"].sum()),
            "amplitude_mm": float(own[f"{basis}_mm"].mean()),
            "width_mm": float(own[f"{basis}_width_mm"].mean()),
            "difficulty_bits": float(own[f"{basis}_bits"].mean()),
            "movement_time_s": float(own["time_s"].mean()),
        }


def _line(people: pd.DataFrame, points: Sequence[Row], condition: str, basis: str) -> Row:
    """The line through a condition's points; throughput is the mean over participants of their means over blocks."""
    amplitude, width, bits, time_s = (
        np.array([point[name] for point in points])
        for name in ("amplitude_mm", "width_mm", "difficulty_bits", "movement_time_s")
    )
    found = fitted(Blocks(amplitude, width, bits, time_s, np.array([point["movements"] for point in points])))
    throughput = (people[f"{basis}_bits"] / people["time_s"]).groupby(people["participant"]).mean().mean()
    slope_low, slope_high = found.ci_slope or (None, None)
    intercept_low, intercept_high = found.ci_intercept or (None, None)
    return {
        "condition": condition,
        "difficulty": basis,
        "n": people["participant"].nunique(),
        "blocks": found.blocks,
        "intercept_s": found.intercept_s,
        "intercept_ci_low_s": intercept_low,
        "intercept_ci_high_s": intercept_high,
        "slope_s_bit": found.slope_s_bit,
        "slope_ci_low_s_bit": slope_low,
        "slope_ci_high_s_bit": slope_high,
        "r_squared": found.r_squared,
        "throughput_bits_s": float(throughput),
        "status": found.status,
        "remark": _remark(found.blocks, found.slope_s_bit, found.intercept_s, found.r_squared),
    }


def _remark(blocks: int, slope_s_bit: float | None, intercept_s: float | None, r_squared: float | None) -> str | None:
    """What speaks against reading the line as Fitts' law."""
    if blocks < BLOCKS_MIN:
        return f"fewer than {BLOCKS_MIN} indices of difficulty, which is too few for a line"
    remarks = []
    if blocks == BLOCKS_MIN:
        remarks.append("a line through three points has one degree of freedom")
    if slope_s_bit is not None and slope_s_bit <= 0:
        remarks.append("movement time does not rise with difficulty")
    if r_squared is not None and r_squared < R_SQUARED_MIN:
        remarks.append(f"R² is below {R_SQUARED_MIN:g}: movement time is not a line over difficulty")
    if intercept_s is not None and intercept_s < INTERCEPT_MIN_S:
        remarks.append(
            f"an intercept below {MINUS}{-1000 * INTERCEPT_MIN_S:g} ms, where no movement time can be, points to"
            " something other than difficulty"
        )
    return "; ".join(remarks) or None

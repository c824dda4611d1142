"""The further reference cases: data that R scripts make, and what R computes of them, beside the scripts."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.statistics.arrays import FloatArray

FOLDER = Path(__file__).resolve().parents[1] / "data" / "statistics_r"


def expected(name: str) -> dict[str, Any]:
    """What R computes of a case, and the versions that computed it."""
    content: dict[str, Any] = json.loads((FOLDER / name / "expected.json").read_text())
    return content


def rows(name: str, file: str = "data.csv") -> list[dict[str, str]]:
    """The rows of a case's data."""
    return list(csv.DictReader((FOLDER / name / file).read_text().splitlines()))


def matrix(rows: list[dict[str, str]], across: str, value: str, down: str = "participant") -> FloatArray:
    """Values (n, k), a row for each of `down` and a column for each of `across`, both as they first come."""
    people, columns = (list(dict.fromkeys(row[name] for row in rows)) for name in (down, across))
    table = np.full((len(people), len(columns)), np.nan)
    for row in rows:
        table[people.index(row[down]), columns.index(row[across])] = float(row[value] or "nan")
    return table

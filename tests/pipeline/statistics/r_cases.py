"""Reference cases whose R scripts are kept beside them, as plain arrays."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

CASES = Path(__file__).resolve().parents[2] / "data" / "statistics_r"
"""Each: data.csv, expected.json (what R computes of it, with versions), by a script NAME.R beside the folders."""

Row = dict[str, str]


def expected(case: str) -> dict[str, Any]:
    """What R computes of a case."""
    content: dict[str, Any] = json.loads((CASES / case / "expected.json").read_text())
    return content


def with_key(key: str) -> list[str]:
    """The cases of which R has this."""
    return [path.parent.name for path in sorted(CASES.glob("*/expected.json")) if key in json.loads(path.read_text())]


def rows(case: str) -> list[Row]:
    """The data as they stand in the file."""
    return list(csv.DictReader((CASES / case / "data.csv").read_text().splitlines()))


def levels(case: str, column: str) -> list[str]:
    """A column's levels in the order of the file."""
    return list(dict.fromkeys(row[column] for row in rows(case)))


def groups(case: str) -> dict[str, np.ndarray]:
    """The values of each group."""
    return {
        name: np.array([float(row["value"]) for row in rows(case) if row["group"] == name])
        for name in levels(case, "group")
    }


def close(found: Any, wanted: Any, tolerance: float = 1e-6) -> None:
    """Equal within the tolerance, number by number."""
    if isinstance(wanted, Sequence):
        assert len(found) == len(wanted)
        for one, other in zip(found, wanted, strict=True):
            close(one, other, tolerance)
    else:
        assert found == pytest.approx(wanted, rel=tolerance, abs=1e-9)

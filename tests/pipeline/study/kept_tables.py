"""Bundled cases of tables as people keep them, copied, with what their messages propose."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pandas as pd

from tests.pipeline.helpers import Steadyhand

CASES = Path(__file__).resolve().parents[2] / "data" / "cases_in"
Folder = Callable[..., Path]


def copied(case: str, tmp_path: Path, **changes: str) -> Path:
    """A copy of a case, with lines added to its study.yaml."""
    study = tmp_path / case
    shutil.copytree(CASES / case, study)
    add(study, *changes.values())
    return study


def add(study: Path, *lines: str) -> None:
    """Add lines to the copy's study.yaml."""
    path = study / "study.yaml"
    path.write_text("\n".join([path.read_text(encoding="utf-8"), *lines, ""]), encoding="utf-8")


def proposed(message: str) -> list[str]:
    """The lines that a message says to write into study.yaml."""
    (text,) = re.findall(r"write (\w+: .+?) in study\.yaml", message)
    return re.split(r" and (?=\w+: )", text)


def means(steadyhand: Steadyhand, measure: str) -> dict[str, float]:
    return {r["condition"]: r["mean"] for r in steadyhand.results()["descriptives"] if r["measure"] == measure}


def squared_errors(trials: pd.DataFrame) -> pd.Series:
    """Mean squared error by condition over the participants' means, from trials with our column names."""
    errors = (trials["selected_x_mm"] - trials["target_x_mm"]) ** 2
    errors += (trials["selected_y_mm"] - trials["target_y_mm"]) ** 2
    return errors.groupby([trials["participant"], trials["condition"]]).mean().groupby("condition").mean()

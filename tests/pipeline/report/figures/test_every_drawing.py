"""What holds of every figure."""

from __future__ import annotations

import importlib
import pkgutil

import pytest

from pipeline.report import figures
from pipeline.report.figures.drawing import Drawing

DRAWINGS = {
    f"{module.name}.{name}": value
    for module in pkgutil.iter_modules(figures.__path__)
    for name, value in vars(importlib.import_module(f"{figures.__name__}.{module.name}")).items()
    if isinstance(value, Drawing)
}


@pytest.mark.parametrize("name", DRAWINGS)
def test_every_figure_is_drawn_in_the_style_and_the_family_of_the_report(name: str) -> None:
    """`styled` wraps the function that draws; one without it is in whatever style matplotlib happens to have."""
    assert hasattr(DRAWINGS[name].__wrapped__, "__wrapped__"), f"{name} has no @styled"  # type: ignore[attr-defined]

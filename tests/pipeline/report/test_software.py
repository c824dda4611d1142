"""The libraries that computed something are named, with their publications; the others are not."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import pytest

from pipeline.engine.provenance import OF_STATISTICS
from pipeline.study.statistical_tests import TESTS
from tests.pipeline.analysis.test_options import TIMES, Values, read, study
from tests.pipeline.helpers import Steadyhand

pytestmark = pytest.mark.usefixtures("no_figures", "blank_print")

ANSWERS: Values = {"m": {"A": [0, 1, 0, 0, 1, 0], "B": [1, 1, 1, 0, 1, 1]}}


@pytest.mark.parametrize(
    ("values", "entry", "used"),
    [
        (TIMES, "measure: time_s, test: t_paired", set()),
        (TIMES, "measure: '*', test: t_paired, adjust: holm", {"statsmodels"}),
        (ANSWERS, "measure: m, test: mcnemar", {"statsmodels"}),
        (TIMES, "measure: time_s, test: art_anova, within: [condition, half]", {"pingouin"}),
    ],
)
def test_a_report_names_what_computed_its_statistics(
    steadyhand: Steadyhand, tmp_path: Path, values: Values, entry: str, used: set[str]
) -> None:
    folder = study(tmp_path / "s", values, [entry])
    if "half" in entry:
        rows = (folder / "measures.csv").read_text(encoding="utf-8").splitlines()
        twice = [f"{row},{half}" for row in rows[1:] for half in "xy"]
        (folder / "measures.csv").write_text("\n".join([f"{rows[0]},half", *twice]) + "\n", encoding="utf-8")
    page = read(steadyhand, folder)
    for name in OF_STATISTICS:
        assert (f"{name} {version(name)}" in page) == (name in used), name
        assert (f"{name}, version {version(name)}" in (steadyhand.out / "references.bib").read_text()) == (name in used)


def test_every_library_of_a_test_is_one_that_can_be_named() -> None:
    assert {name for test in TESTS.values() for name in test.libraries} == set(OF_STATISTICS)


def test_the_versions_of_the_libraries_are_said_once(steadyhand: Steadyhand, tmp_path: Path) -> None:
    page = read(steadyhand, study(tmp_path / "s", TIMES, ["measure: time_s, test: t_paired"]))
    assert page.count(version("numpy")) == page.count(f"numpy {version('numpy')}") == 1
    provenance = (steadyhand.out / "provenance.json").read_text(encoding="utf-8")
    assert all(version(name) in provenance for name in ("numpy", "orjson", "typst"))

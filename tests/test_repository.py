"""The repository itself: what its pages say is so, and what must not be in it."""

from __future__ import annotations

import ast
import re
import subprocess
from dataclasses import fields
from typing import get_args

import pytest
import yaml

from fusion_core import ESTIMATORS
from pipeline.study.comparison import Comparison
from pipeline.study.fields import Frozen
from pipeline.study.folder import load_study
from pipeline.study.given_tables import (
    MEASURE_REQUIRED,
    MEASURE_RESERVED,
    RATING_REQUIRED,
    TRIAL_OPTIONAL,
    TRIAL_REQUIRED,
)
from pipeline.study.settings import Display, QualityLimits, Study
from pipeline.study.streams import OperatorTerm, Stream
from pipeline.study.yaml_text import parse
from pipeline.tables.catalogue import TABLES
from pipeline.tables.columns import FLOAT
from tests.conftest import CLONE

REFERENCE = (CLONE / "studies" / "README.md").read_text(encoding="utf-8")


def listed_after(heading: str) -> set[str]:
    """The names in the first column of the table under a heading."""
    part = REFERENCE.split(f"## {heading}\n", 1)[1].split("\n## ", 1)[0]
    return {
        name
        for line in part.splitlines()
        if line.startswith("| `")
        for name in re.findall(r"`([^`]+)`", line.split("|")[1])
    }


def test_every_key_of_a_study_is_in_the_reference() -> None:
    table = REFERENCE.split("| key | meaning | if absent |", 1)[1].split("\n\n", 1)[0]
    assert {re.findall(r"`(\w+)`", line)[0] for line in table.splitlines() if line.startswith("| `")} == set(
        Study.model_fields
    )
    models: list[type[Frozen]] = [*get_args(get_args(Stream)[0]), OperatorTerm, Display, Comparison, QualityLimits]
    for model in models:
        for key in model.model_fields:
            assert f"`{key}`" in REFERENCE, key


def test_every_estimator_and_parameter_is_in_the_reference() -> None:
    assert listed_after("Estimators") == set(ESTIMATORS)
    for name, kind in ESTIMATORS.items():
        line = next(line for line in REFERENCE.splitlines() if line.startswith(f"| `{name}`"))
        for field in fields(kind):
            if field.name != "sensors":
                assert f"`{field.name}`" in line, (name, field.name)


def test_the_reference_states_the_default_limits_of_quality() -> None:
    part = REFERENCE.split("| limit | what is judged | default |", 1)[1].split("\n\n", 1)[0]
    stated = re.findall(r"^\| `(\w+)` .*`(\[.*?\])` \|$", part, flags=re.MULTILINE)
    assert QualityLimits.model_validate({name: yaml.safe_load(limits) for name, limits in stated}) == QualityLimits()
    assert [name for name, _ in stated] == list(QualityLimits.model_fields)


def test_every_column_of_the_tables_is_in_the_reference() -> None:
    for column in (*TRIAL_REQUIRED, *TRIAL_OPTIONAL, *RATING_REQUIRED, *MEASURE_REQUIRED, *MEASURE_RESERVED):
        assert f"`{column}`" in REFERENCE, column


def test_the_example_of_the_reference_is_a_study() -> None:
    example = re.findall(r"```yaml\n(.*?)```", REFERENCE, flags=re.DOTALL)[0]
    study = parse(Study, yaml.safe_load(example), CLONE / "studies" / "README.md")
    assert study.conditions == ("kinect", "fusion")


@pytest.mark.parametrize("name", ["feng2016", "reach"])
def test_the_bundled_studies_load(name: str) -> None:
    assert load_study(CLONE / "studies" / name).title


def test_the_example_of_fusion_core_runs() -> None:
    text = (CLONE / "fusion_core" / "README.md").read_text(encoding="utf-8")
    namespace: dict[str, object] = {}
    exec(re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)[0], namespace)  # noqa: S102
    assert hasattr(namespace["track"], "mean")


def test_units_are_in_the_names_of_columns() -> None:
    of_measure = {"value", "statistic", "sd", "mean", "median", "stated"}
    of_stream = {"residual", "x", "y", "z"}
    bare = of_measure | of_stream  # in the unit of theirs
    dimensionless = {
        "p",
        "p_adjusted",
        "df1",
        "df2",
        "effect_size",
        "reduction",
        "coverage_95",
        "ci_low",
        "ci_high",
        "published_reduction",
        "alpha",
        "slope",
        "ratio_when_trials_double",
        "standardised",
        "quantile",
        "band_low",
        "band_high",
        "r_squared",
    }
    units = ("_bits", "_s_bit", "_mm", "_mm2", "_s", "_ns", "_ms", "_hz", "_mm_s2", "_rad_s", "_95", "_deg")
    for name, table in TABLES.items():
        for column in table.columns:
            if column.kind == FLOAT and column.name not in bare | dimensionless:
                known = column.name.endswith(units) or column.name in ("qx", "qy", "qz", "qw")
                assert known or column.name in ("mean_difference", "stated_sd", "computed_value"), (name, column.name)


def tracked() -> list[str]:
    listed = subprocess.run(["git", "ls-files"], cwd=CLONE, capture_output=True, text=True, check=False)  # noqa: S607
    if listed.returncode or not listed.stdout:
        pytest.skip("not a git checkout")
    return listed.stdout.splitlines()


def private_names_in(text: str) -> list[str]:
    """The private names of our modules that a test imports, changes or uses."""
    if not re.search(r"""\b\w+\._[a-z]|["'.]_[A-Za-z]|import .*\b_[A-Za-z]""", text):
        return []  # to read the syntax of every test takes a second
    tree, modules, found = ast.parse(text), set(), []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(("pipeline", "fusion_core")):
            modules |= {name.asname or name.name for name in node.names if name.name.islower()}
            found += [name.name for name in node.names]
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in modules:
            found.append(node.attr)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "setattr":
            words = [one.value for one in node.args[:2] if isinstance(one, ast.Constant) and isinstance(one.value, str)]
            found += [word.rpartition(".")[2] for word in words if "." not in word or word.startswith("pipeline.")]
    return sorted(name for name in found if name.startswith("_") and not name.endswith("__"))


def test_no_test_reaches_into_a_module() -> None:
    """What a test must set or ask for has a public name; a private one is free to change."""
    assert private_names_in('from pipeline.a import b\nmonkeypatch.setattr(b, "_c", 1)\nb._d()') == ["_c", "_d"]
    found = {name: private_names_in((CLONE / name).read_text(encoding="utf-8")) for name in tracked_tests()}
    assert {name: names for name, names in found.items() if names} == {}


def tracked_tests() -> list[str]:
    """The tests' own modules, but for those that time and count what is inside."""
    return [name for name in tracked() if name.startswith("tests/") and name.endswith(".py") and "/bench" not in name]


def test_no_file_holds_a_path_of_a_machine_or_a_download_address() -> None:
    for name in tracked():
        path = CLONE / name
        if path.suffix in (".mcap", ".png", ".ttf", ".woff2") or not path.is_file():
            continue
        text = path.read_text(encoding="utf-8", errors="replace")  # a table of a case is in another encoding
        assert not re.search(r"(^|[^.\w])/(home|root|work|Users)/", text), name
        if path.suffix == ".lock":
            assert "://" not in text, name


def test_the_bundled_logs_stay_small() -> None:
    size = sum((CLONE / name).stat().st_size for name in tracked() if name.startswith("studies/"))
    assert size < 1_000_000

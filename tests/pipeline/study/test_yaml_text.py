"""YAML as a user wrote it: names stay names, and what cannot be text is an error that names the file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from pipeline.errors import PipelineError
from pipeline.study.folder import load_study
from pipeline.study.yaml_text import read_values, read_yaml
from tests.pipeline.helpers import Steadyhand

Folder = Callable[..., Path]


@pytest.mark.parametrize("written", ["010", "1_000", "0x10", "0b11", "1:30", "1:30.5", "2024-01-31", "1_0.5"])
def test_what_yaml_would_make_another_number_or_a_date_of_stays_as_it_is_written(written: str) -> None:
    assert read_values(written) == [written]


@given(st.floats(allow_nan=False) | st.integers(-(10**18), 10**18))
def test_numbers_as_yaml_itself_writes_them_are_numbers(value: float) -> None:
    (read,) = read_values(yaml.safe_dump(value).splitlines()[0])
    assert (read, type(read)) == (value, type(value))


def test_conditions_that_look_like_numbers_and_dates_are_those_of_the_table(
    folder: Folder, steadyhand: Steadyhand
) -> None:
    rows = "participant,condition,measure,value\n" + "".join(
        f"{person},{condition},m,{person}\n" for person in ("01", "02", "03") for condition in ("010", "2024-01-31")
    )
    settings = "conditions: [010, 2024-01-31]\nmeasures: m.csv\nexclusions: [{participant: 03, reason: tired}]\n"
    assert steadyhand("compare", folder(settings, **{"m.csv": rows})).code == 0
    assert [row["condition"] for row in steadyhand.results()["descriptives"]] == ["010", "2024-01-31"]
    assert steadyhand.results()["descriptives"][0]["n"] == 2


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ("conditions: [a, b]\nfactors: {2024-01-31: between}\n", "has no data"),
        ("conditions: [a, b]\n2024-01-31: x\n", 'unknown key "2024-01-31"'),
        ("conditions: [a, b]\nfactors: {!!timestamp 2024-01-31: between}\n", "a key that is no text"),
        ("conditions: [a, b]\n!!timestamp 2024-01-31: x\n", "a key that is no text"),
        ("title: 'a'\nnotes: \"\\ud800\"\n", "holds half of a surrogate pair"),
    ],
)
def test_a_key_that_is_a_date_is_named_or_refused(folder: Folder, settings: str, said: str) -> None:
    with pytest.raises(PipelineError, match=r"study\.yaml") as raised:
        load_study(folder(settings))
    assert said in str(raised.value)


@given(st.text(st.characters(codec="utf-8"), max_size=40))
def test_any_text_is_settings_or_a_message(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.getbasetemp() / "any.yaml"
    path.write_text(text, encoding="utf-8")
    try:
        assert isinstance(read_yaml(path), dict)
    except PipelineError as error:
        assert str(path) in str(error)

"""A fault in study.yaml is named by the user's own words, whatever they are."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.errors import PipelineError
from pipeline.study.comparison import Comparison
from pipeline.study.folder import load_study
from pipeline.study.settings import Study
from pipeline.study.streams import Stream
from pipeline.study.yaml_text import parse
from tests.pipeline.study.test_study import MEASURES, MINIMAL, Folder

STREAM_KINDS = ("position", "velocity", "linear", "acceleration", "reference", "display")
SIMULATION_KINDS = ("reach", "selection")
OUR_WORDS = (*STREAM_KINDS, *SIMULATION_KINDS, "kind", "topic", "streams", "simulation", "estimators", "workload", "0")

names = st.sampled_from(OUR_WORDS) | st.text(min_size=1, max_size=12)
stream_kinds, simulation_kinds = st.sampled_from(STREAM_KINDS), st.sampled_from(SIMULATION_KINDS)

NEEDED: dict[str, Any] = {
    "velocity": {"noise_sd_mm_s": 1},
    "linear": {"noise_sd": 1, "operator": [{"weight": 1}]},
    "acceleration": {"gravity_mm_s2": [0, 0, -9807]},
}
"""What a kind of stream must say beside its topic."""


def stream(kind: str, **more: object) -> dict[str, object]:
    return {"topic": "/t", "kind": kind, **NEEDED.get(kind, {}), **more}


def known_keys(kind: str) -> set[str]:
    """The keys that a kind of stream has."""
    (model,) = (
        each for each in get_args(get_args(Stream)[0]) if kind in get_args(each.model_fields["kind"].annotation)
    )
    return set(model.model_fields)


def faults(**settings: object) -> list[str]:
    """What a user is told of settings, a line a fault."""
    content = {"conditions": ["a", "b"], "measures": "measures.csv", **settings}
    with pytest.raises(PipelineError) as error:
        parse(Study, content, "study.yaml")
    return str(error.value).split("\nstudy.yaml: ")


def told(*expected: str) -> list[str]:
    """The lines, the first with the file's name before it."""
    return [f"study.yaml: {expected[0]}", *expected[1:]]


def test_streams_named_like_kinds_keep_their_names(folder: Folder) -> None:
    text = """
    streams:
      tracker:   {topic: /t, kind: position, noise_sd_mm: -1}
      reference: {topic: /r, kind: reference, translation: [0, 0, 0]}
      display:   {kind: display}
      position:  {topic: /p, kind: display, noise_sd_mm: 1}
    """
    lines = "\n".join(line.removeprefix("    ") for line in text.splitlines())
    root = folder(MINIMAL + lines, **{"measures.csv": MEASURES})
    with pytest.raises(PipelineError) as error:
        load_study(root)
    assert [line.removeprefix(f"{root / 'study.yaml'}: ") for line in str(error.value).splitlines()] == [
        '"streams.tracker.noise_sd_mm": input should be greater than 0 (found -1)',
        'unknown key "streams.reference.translation"; did you mean "translation_mm"?',
        '"streams.display.topic" is missing',
        'unknown key "streams.position.noise_sd_mm"; known: topic, stamp, latency_s, arrival, '
        "stamp_unit, child, parent, fields, kind, unit",
    ]


@given(name=names, kind=stream_kinds)
def test_a_stream_keeps_its_name(name: str, kind: str) -> None:
    lacking = {key: value for key, value in stream(kind).items() if key != "topic"}
    assert faults(streams={name: lacking}) == told(f'"streams.{name}.topic" is missing')
    late = faults(streams={name: stream(kind, latency_s=-1)})
    assert late == told(f'"streams.{name}.latency_s": input should be greater than or equal to 0 (found -1)')


@given(name=names, kind=stream_kinds, key=names)
def test_an_unknown_key_of_a_stream_keeps_both_names(name: str, kind: str, key: str) -> None:
    if key not in known_keys(kind):
        (line,) = faults(streams={name: stream(kind, **{key: None})})
        assert line.startswith(told(f'unknown key "streams.{name}.{key}"')[0])


@given(name=names, kind=names)
def test_a_stream_without_a_kind_that_is_known_is_told_all_of_them(name: str, kind: str) -> None:
    expected = told(f'"streams.{name}" needs a kind: {", ".join(STREAM_KINDS)}')
    assert faults(streams={name: {"topic": "/t"}}) == expected
    if kind not in STREAM_KINDS:
        assert faults(streams={name: {"topic": "/t", "kind": kind}}) == expected


@given(name=names)
def test_an_operators_term_is_named_by_its_place(name: str) -> None:
    found = faults(streams={name: stream("linear", operator=[{"weight": 1}, {"derivative": 1}])})
    assert found == told(f'"streams.{name}.operator.1.weight" is missing')


@given(name=names)
def test_an_estimator_keeps_its_name(name: str) -> None:
    assert faults(estimators={name: {"use": ["x"]}}) == told(f'"estimators.{name}.type" is missing')


@given(name=names)
def test_a_condition_keeps_its_name(name: str) -> None:
    found = faults(conditions=[name], shown={name: 5})
    assert found == told(f'"shown.{name}": input should be a valid string (found 5)')


@given(key=names)
def test_a_comparison_is_named_by_its_place(key: str) -> None:
    entries = [{"measure": "m", "test": "t_paired"}, {"test": "t_paired"}]
    assert faults(comparisons=entries) == told('"comparisons.1.measure" is missing')
    if key not in Comparison.model_fields:
        (line,) = faults(comparisons=[{**entries[0], key: 1}])
        assert line.startswith(told(f'unknown key "comparisons.0.{key}"')[0])


@given(kind=simulation_kinds, other=names)
def test_a_simulation_is_named_without_its_kind(kind: str, other: str) -> None:
    count = "recordings" if kind == "reach" else "participants"
    assert faults(simulation={"kind": kind, count: 1}) == told('"simulation.seed" is missing')
    expected = told('"simulation" needs a kind: reach, selection')
    assert faults(simulation={"seed": 1}) == expected
    if other not in SIMULATION_KINDS:
        assert faults(simulation={"kind": other, "seed": 1}) == expected


@given(scale=names)
def test_a_scale_of_a_simulations_workload_keeps_its_name(scale: str) -> None:
    workload = {"questionnaire": "q", "usual": {}, "scales": {scale: {}}}
    found = faults(simulation={"kind": "selection", "seed": 1, "participants": 1, "workload": workload})
    assert found == told(f'"simulation.workload.scales.{scale}.base" is missing')


def test_the_words_above_are_those_of_the_settings() -> None:
    content: dict[str, Any] = {"conditions": ["a"], "measures": "m.csv"}
    for kind in STREAM_KINDS:
        assert parse(Study, {**content, "streams": {"s": stream(kind)}}, Path("study.yaml")).streams["s"].kind == kind

"""One record per measure, questionnaire and test: what is derived from them fits together."""

from __future__ import annotations

import re
from typing import get_args

from hypothesis import given
from hypothesis import strategies as st

from pipeline.analysis.comparisons import RUN
from pipeline.report.prose import references
from pipeline.study.comparison import Comparison
from pipeline.study.measures import MEASURES, QUESTIONNAIRES, Section, measure, measure_order
from pipeline.study.scoring_rules import RULES
from pipeline.study.statistical_tests import ADJUSTMENTS, TESTS
from pipeline.words.names import measure_label


def test_every_test_of_study_yaml_is_computed_by_a_function() -> None:
    assert set(RUN) == set(TESTS)


def test_what_is_cited_stands_in_the_bibliography() -> None:
    cited = {one.cite for one in ADJUSTMENTS.values()}
    for keys in (*(one.cite for one in MEASURES.values()), *(one.cite for one in QUESTIONNAIRES.values())):
        cited.update(keys)
    cited.update(key for one in TESTS.values() for key in one.cite)
    cited.update(key for one in RULES.values() for key in one.cite)
    assert cited <= set(references.entries())


def test_every_option_of_an_entry_belongs_to_a_test_that_knows_it() -> None:
    always = {"measure", "test", "adjust", "family", "missing", "hypothesis", "direction"}
    assert {option for test in TESTS.values() for option in test.options} == set(Comparison.model_fields) - always


def test_units_are_those_of_the_names() -> None:
    """A measure's name ends with its unit, so that the unit in its record cannot say something else."""
    spelled = {"px²": "px2", "mm²": "mm2", "bit/s": "bits_s", "px": "px", "mm": "mm", "s": "s"}
    for record in MEASURES.values():
        assert not record.unit or record.name.endswith(f"_{spelled[record.unit]}"), record.name


@given(st.text(st.characters(codec="utf-8", exclude_categories=["Cc"]), min_size=1))
def test_any_name_has_a_record_with_a_label(name: str) -> None:
    record = measure(name)
    assert record.name == name
    assert record.section in get_args(Section)
    assert re.sub(r"\s", "", measure_label(name)) or not re.sub(r"[\s_]", "", name)


def test_a_scale_that_nobody_knows_is_no_ratio() -> None:
    """A percentage of change needs a zero that means none (Stevens 1946); the name of a score does not tell that."""
    assert measure("score").scale == "unknown"
    assert measure("nasa_tlx/mental").scale == "interval"
    assert measure("reaction_ms").scale == measure("completion_time_s").scale == "ratio"


def test_scales_stand_in_the_order_of_their_questionnaire_and_the_total_last() -> None:
    names = [f"nasa_tlx/{scale}" for scale in ("total", "frustration", "mental", "own")]
    assert sorted(names, key=measure_order) == [
        "nasa_tlx/mental",
        "nasa_tlx/frustration",
        "nasa_tlx/own",
        "nasa_tlx/total",
    ]

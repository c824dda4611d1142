"""Which tests are adjusted together."""

from __future__ import annotations

from typing import Any

import pytest

from pipeline.analysis.families import MEASURES, PAIRS, adjust, grouped
from pipeline.study.comparison import Comparison, matching_measures

Row = dict[str, Any]


def entry(test: str, **options: Any) -> Comparison:
    return Comparison.model_validate({"measure": ["a", "b"], "test": test, "adjust": "holm", **options})


def row(measure: str, effect: str, p: float, contrast: str | None = None) -> Row:
    return {
        "measure": measure,
        "effect": effect,
        "contrast": contrast,
        "adjust": "holm",
        "p": p,
        "p_adjusted": None,
        "details": {},
    }


def adjusted(*entries: tuple[Comparison, list[Row]]) -> list[float]:
    """The adjusted p of every row."""
    adjust(entries)
    return [one["p_adjusted"] for _, rows in entries for one in rows]


def test_the_measures_of_an_entry_are_a_family_effect_by_effect() -> None:
    """Holm over two is 2 p of the smaller one and the larger p; over all four it would be 4 p, 3 p, ..."""
    rows = [
        row(measure, effect, p)
        for effect, of_effect in {"condition": (0.01, 0.02), "size": (0.03, 0.04)}.items()
        for measure, p in zip("ab", of_effect, strict=True)
    ]
    ps = adjusted((entry("rm_anova", within=["condition", "size"]), rows))
    assert ps == pytest.approx([0.02, 0.02, 0.06, 0.06])
    assert {one["details"]["family_size"] for one in rows} == {2}
    assert {one["details"]["family"] for one in rows} == {MEASURES}


def test_several_pairs_are_a_family_measure_by_measure_and_effect_by_effect() -> None:
    rows = [
        row(measure, effect, p, contrast)
        for measure, effect, of_pairs in (
            ("a", "condition", (0.01, 0.02)),
            ("a", "size", (0.03, 0.04)),
            ("b", "condition", (0.001, 0.2)),
        )
        for contrast, p in zip(("A - B", "A - C"), of_pairs, strict=True)
    ]
    ps = adjusted((entry("t_paired"), rows))
    assert ps == pytest.approx([0.02, 0.02, 0.06, 0.06, 0.002, 0.2])
    assert {one["details"]["family"] for one in rows} == {PAIRS}


def test_one_pair_of_each_measure_is_adjusted_over_the_measures() -> None:
    rows = [row("a", "condition", 0.01, "A - B"), row("b", "condition", 0.02, "A - B")]
    assert adjusted((entry("t_paired"), rows)) == pytest.approx([0.02, 0.02])


def test_two_entries_are_two_families_and_one_where_they_name_it() -> None:
    def pair(**options: Any) -> list[tuple[Comparison, list[Row]]]:
        return [
            (entry("t_paired", **options), [row(name, "condition", p, "A - B")])
            for name, p in (("a", 0.01), ("b", 0.02))
        ]

    assert adjusted(*pair()) == pytest.approx([0.01, 0.02])
    assert adjusted(*pair(family="main")) == pytest.approx([0.02, 0.02])


def test_pairs_beneath_an_omnibus_test_stay_out_of_the_family_that_its_entry_names() -> None:
    omnibus = row("a", "condition", 0.01)
    pairs = [row("a", "condition", p, contrast) for p, contrast in ((0.01, "A - B"), (0.02, "A - C"), (0.03, "B - C"))]
    other = row("b", "condition", 0.02, "A - B")
    entries = [(entry("rm_anova", family="main"), [omnibus, *pairs]), (entry("wilcoxon", family="main"), [other])]
    families = grouped(entries)
    assert families["main",] == [omnibus, other]
    assert adjusted(*entries) == pytest.approx([0.02, 0.03, 0.04, 0.04, 0.02])


def test_a_pattern_stands_for_measures_and_never_for_a_total() -> None:
    known = ["tlx/mental", "tlx/effort", "tlx/total", "sus/total", "time_s"]
    assert matching_measures("tlx/*", known) == ["tlx/mental", "tlx/effort"]
    assert matching_measures("*", known) == ["tlx/mental", "tlx/effort", "time_s"]
    assert matching_measures("tlx/total", known) == ["tlx/total"]
    assert matching_measures("t.me_s", known) == []

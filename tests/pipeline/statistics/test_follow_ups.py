"""Pairs after a test of several factors: paired tests of means over the other factors."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from pipeline.statistics import pairs
from tests.pipeline.helpers import Steadyhand
from tests.pipeline.reference import (
    CASES,
    compared,
    study_of,
    the,
)

Folder = Callable[..., Path]


def test_follow_ups_of_two_factors_are_paired_tests_of_means(folder: Folder, steadyhand: Steadyhand) -> None:
    case = "rm2x3_within_n12"
    tests = ["test: rm_anova, within: [condition, task]", "test: rm_anova, within: [condition, task], follow_up: none"]
    rows = compared(steadyhand, study_of(folder, case, "mean_over_tasks", ["kinect", "fusion"], tests))
    assert [(row["effect"], row["contrast"]) for row in rows if row["contrast"] is not None] == [
        *(("task", pair) for pair in ("far - mid", "far - near", "mid - near")),
        *(("condition:task", f"kinect - fusion | {task}") for task in ("far", "mid", "near")),
    ]
    values = pd.read_csv(CASES / case / "data.csv")
    wide = values.pivot_table(index="participant", columns=["condition", "task"], values="value")
    kinect, fusion = wide["kinect"], wide["fusion"]
    simple = [row for row in rows if row["effect"] == "condition:task" and row["contrast"] is not None]
    p = [stats.ttest_rel(kinect[task], fusion[task]).pvalue for task in ("far", "mid", "near")]
    assert [row["p"] for row in simple] == pytest.approx(p)
    least, middle, most = sorted(p)
    by_holm = {least: 3 * least, middle: max(3 * least, 2 * middle), most: max(3 * least, 2 * middle, most)}
    assert [row["p_adjusted"] for row in simple] == pytest.approx([min(1, by_holm[one]) for one in p])
    means = (kinect + fusion) / 2
    far = the(rows, effect="task", contrast="far - mid")
    assert far["statistic"] == pytest.approx(stats.ttest_rel(means["far"], means["mid"]).statistic)
    assert (far["test"], far["adjust"], far["statistic_name"]) == ("rm_anova", "holm", "t")


def test_pairs_of_three_factors_average_over_the_factor_outside() -> None:
    values = np.random.default_rng(0).normal(size=(5, 2, 3, 2))
    levels = [["a", "b"], ["x", "y", "z"], ["1", "2"]]
    found = pairs.follow_ups(values, ["size", "condition", "side"], levels)
    by_name = {(pair.effect, pair.contrast): pair for pair in found}
    assert len(found) == len(by_name) == 3 + 2 * 3 + 2 + 2 * 3 + 4 * 3
    pair = by_name["size:condition", "x - z | b"]
    assert pair.first == pytest.approx(values[:, 1, 0, :].mean(axis=1))
    assert pair.second == pytest.approx(values[:, 1, 2, :].mean(axis=1))
    pair = by_name["size:condition:side", "y - z | a, 2"]
    assert pair.second == pytest.approx(values[:, 0, 2, 1])
    pair = by_name["size:side", "a - b | 1"]
    assert pair.first == pytest.approx(values[:, 0, :, 0].mean(axis=1))

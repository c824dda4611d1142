"""Tukey and Kramer's test: against what R prints of its own data sets, and against laws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from scipy import stats

from pipeline.statistics import EMPTY_GROUP, EQUAL_IN_GROUPS, OK, ONE_IN_GROUP
from pipeline.statistics.result import Result
from pipeline.statistics.tukey import tukey_kramer

PLANTS = {  # PlantGrowth of R's datasets (Dobson 1983)
    "ctrl": [4.17, 5.58, 5.18, 6.11, 4.50, 4.61, 5.17, 4.53, 5.33, 5.14],
    "trt1": [4.81, 4.17, 4.41, 3.59, 5.87, 3.83, 6.03, 4.89, 4.32, 4.69],
    "trt2": [6.31, 5.12, 5.54, 5.50, 5.37, 5.29, 4.92, 6.15, 5.80, 5.26],
}
PLANTS_IN_R = {  # TukeyHSD(aov(weight ~ group, PlantGrowth)): diff, lwr, upr, p adj
    "trt1-ctrl": (-0.371, -1.0622161, 0.3202161, 0.3908711),
    "trt2-ctrl": (0.494, -0.1972161, 1.1852161, 0.1979960),
    "trt2-trt1": (0.865, 0.1737839, 1.5562161, 0.0120064),
}
CHICKS = {  # chickwts of R's datasets (McNeil 1977): groups of 10 to 14
    "casein": [368, 390, 379, 260, 404, 318, 352, 359, 216, 222, 283, 332],
    "horsebean": [179, 160, 136, 227, 217, 168, 108, 124, 143, 140],
    "linseed": [309, 229, 181, 141, 260, 203, 148, 169, 213, 257, 244, 271],
    "meatmeal": [325, 257, 303, 315, 380, 153, 263, 242, 206, 344, 258],
    "soybean": [243, 230, 248, 327, 329, 250, 193, 271, 316, 267, 199, 171, 158, 248],
    "sunflower": [423, 340, 392, 339, 341, 226, 320, 295, 334, 322, 297, 318],
}
CHICKS_IN_R = {  # TukeyHSD(aov(weight ~ feed, chickwts))
    "linseed-casein": (-104.833333, -170.587491, -39.07918, 0.0002100),
    "meatmeal-casein": (-46.674242, -113.906207, 20.55772, 0.3324584),
    "soybean-casein": (-77.154762, -140.517054, -13.79247, 0.0083653),
    "sunflower-casein": (5.333333, -60.420825, 71.08749, 0.9998902),
    "linseed-horsebean": (58.550000, -10.413543, 127.51354, 0.1413329),
    "meatmeal-horsebean": (116.709091, 46.335105, 187.08308, 0.0001062),
    "soybean-meatmeal": (-30.480519, -95.375109, 34.41407, 0.7391356),
    "sunflower-soybean": (82.488095, 19.125803, 145.85039, 0.0038845),
}


def pairs_of(data: Mapping[str, Sequence[float]]) -> list[Result]:
    """Every two groups of data that several tests only read: a quarter of a second each."""
    return _pairs_of(tuple((name, tuple(values)) for name, values in data.items()))


@cache
def _pairs_of(data: tuple[tuple[str, tuple[float, ...]], ...]) -> list[Result]:
    return tukey_kramer([np.array(values, float) for _, values in data], [name for name, _ in data])


@pytest.mark.parametrize(("data", "in_r"), [(PLANTS, PLANTS_IN_R), (CHICKS, CHICKS_IN_R)])
def test_pairs_are_those_that_r_prints(data: dict[str, list[float]], in_r: dict[str, tuple[float, ...]]) -> None:
    found = {row.contrast: row for row in pairs_of(data)}
    assert len(found) == len(data) * (len(data) - 1) // 2
    for names, (difference, low, high, p) in in_r.items():
        later, earlier = names.split("-")  # R takes the later group minus the earlier one
        row = found[f"{earlier} - {later}"]
        means = np.mean(data[earlier]) - np.mean(data[later])
        assert means == pytest.approx(-difference, abs=5e-7)
        assert row.details["ci_difference"] == pytest.approx([-high, -low], abs=5e-6)
        assert row.p == pytest.approx(p, abs=5e-8)


def test_of_two_groups_it_is_students_t() -> None:
    first, second = np.array(PLANTS["ctrl"]), np.array(CHICKS["linseed"][:7]) / 40
    (row,) = tukey_kramer([first, second], "ab")
    student = stats.ttest_ind(first, second)
    assert row.statistic == pytest.approx(student.statistic)
    assert row.p == pytest.approx(student.pvalue, rel=1e-9)
    interval = student.confidence_interval()
    assert row.details["ci_difference"] == pytest.approx([interval.low, interval.high], rel=1e-9)


def test_the_effect_size_is_over_the_sd_within_groups_and_its_interval_holds_it() -> None:
    groups = [np.array(values, float) for values in CHICKS.values()]
    within = np.concatenate([group - group.mean() for group in groups])
    sd = np.sqrt(np.sum(within**2) / (len(within) - len(groups)))
    for row, (one, other) in zip(pairs_of(CHICKS), combinations(groups, 2), strict=True):
        assert row.effect_size == pytest.approx((one.mean() - other.mean()) / sd)
        assert row.df2 == len(within) - len(groups)
        assert np.diff([row.ci_low, row.effect_size, row.ci_high]).min() > 0


@pytest.mark.parametrize("unit", [1e-300, 1e-3, 1e200])
def test_the_unit_does_not_matter(unit: float) -> None:
    plain = pairs_of(PLANTS)
    scaled = tukey_kramer([np.array(values) * unit for values in PLANTS.values()], [*PLANTS])
    for one, other in zip(plain, scaled, strict=True):
        assert other.p == pytest.approx(one.p)
        assert other.effect_size == pytest.approx(one.effect_size)
        assert other.details["ci_difference"] == pytest.approx([unit * end for end in one.details["ci_difference"]])


def test_what_cannot_be_tested_says_why() -> None:
    one = np.array([1.0, 2.0, 4.0])
    flat = np.array([2.0, 2.0])
    assert tukey_kramer([one], ["a"]) == []
    assert {row.status for row in tukey_kramer([one, np.array([])], "ab")} == {EMPTY_GROUP}
    assert {row.status for row in tukey_kramer([flat, flat + 1], "ab")} == {EQUAL_IN_GROUPS}
    assert {row.status for row in tukey_kramer([one[:1], one[1:2]], "ab")} == {ONE_IN_GROUP}
    assert {row.status for row in tukey_kramer([one, one + 1, flat], "abc")} == {OK}

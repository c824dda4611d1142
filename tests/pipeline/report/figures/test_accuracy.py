"""Error, lag, their trade-off and calibration: means over sessions, shares over instants."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import LineCollection
from scipy import stats

from pipeline.report import figures
from pipeline.report.figures.stated_sd import nine_of_ten, shares
from pipeline.tables import table as tables
from pipeline.words.accuracy_reference import SMOOTHED
from tests.pipeline.report.figures.drawn import pictures, saved, texts


def accuracy(**estimators: tuple[list[float], list[float]]) -> pd.DataFrame:
    """RMSE in mm and lag in s of each session."""
    return tables.frame(
        "accuracy",
        [
            {"session": f"s{place}", "estimator": name, "rmse_mm": rmse, "lag_s": lag}
            for name, columns in estimators.items()
            for place, (rmse, lag) in enumerate(zip(*columns, strict=True))
        ],
    )


FOUND = accuracy(raw=([30, 34], [0.11, 0.13]), good=([9, 11], [-0.002, 0.004]), quick=([20, 22], [0.0, 0.0]))


def test_least_error_and_least_lag_are_named(tmp_path: Path) -> None:
    shown = texts(figures.errors(FOUND), tmp_path)
    assert {"raw", "good", "quick", "RMSE against the reference (mm)", "Lag behind the reference (ms)"} <= set(shown)
    assert "Error (n = 2 sessions)" in shown
    said = figures.errors.words(FOUND).caption
    assert "Smallest RMSE: good, 10.00 mm; largest: raw, 32.00 mm. Smallest lag: quick, 0 ms." in said


def test_distances_from_smoothed_readings_are_no_errors_and_have_no_winner(tmp_path: Path) -> None:
    found = FOUND.assign(reference=SMOOTHED)
    axes = {"RMSE from the smoothed readings (mm)", "Lag behind the smoothed readings (ms)"}
    for drawing in (figures.errors, figures.lag_and_error):
        shown = texts(drawing(found), tmp_path)
        assert axes <= set(shown)
        assert "Error" not in " ".join(shown)
        said = " ".join(drawing.words(found))
        assert "the smoothed readings" in said
        assert [word for word in ("eference", "mallest", "etter", "No other") if word in said] == []


def test_intervals_of_the_trade_off_are_over_sessions(tmp_path: Path) -> None:
    figure = figures.lag_and_error(FOUND)
    bars = figure.axes[0].containers[0].get_children()[-2]  # of the first estimator's RMSE
    assert isinstance(bars, LineCollection)
    low, high = stats.t.interval(0.95, 1, 32, stats.sem([30, 34]))
    np.testing.assert_allclose(np.sort(np.asarray(bars.get_segments()[0])[:, 0]), [low, high])
    assert "raw (n = 2)" in texts(figure, tmp_path)
    assert "than good and quick" in figures.lag_and_error.words(FOUND).caption


@pytest.mark.parametrize(
    "found",
    [
        accuracy(one=([5.0], [0.1])),
        accuracy(one=([5.0], [np.nan])),
        accuracy(one=([np.nan], [0.1]), two=([0.0, 0.0], [0.0, 0.0])),
        accuracy(one=([5.0] * 3, [0.1] * 3), two=([900.0] * 3, [0.1] * 3)),
    ],
)
def test_one_session_missing_and_constant_accuracy(found: pd.DataFrame, tmp_path: Path) -> None:
    for draw, say in ((figures.errors, figures.errors.words), (figures.lag_and_error, figures.lag_and_error.words)):
        saved(draw(found), tmp_path)
        assert "nan" not in f"{say(found)}"


def test_many_sessions_are_pixels(tmp_path: Path) -> None:
    many = accuracy(one=(list(np.linspace(5, 9, 3000)), list(np.linspace(0.01, 0.05, 3000))))
    path = saved(figures.errors(many), tmp_path)
    assert pictures(path) > 0
    assert path.stat().st_size < 200_000


def counts(estimator: str, session: str, within: dict[int, int], n: int) -> list[dict[str, object]]:
    return [
        {"session": session, "estimator": estimator, "percent_of_sd": k, "within": count, "n": n}
        for k, count in within.items()
    ]


def test_calibration_pools_instants_and_not_shares(tmp_path: Path) -> None:
    table = tables.frame(
        "calibration",
        [
            *counts("gp", "s1", {100: 90, 196: 100}, 100),
            *counts("gp", "s2", {100: 0, 196: 500}, 900),
            *counts("raw", "s1", {100: 50, 196: 60}, 100),
        ],
    )
    k, share = shares(table[table["estimator"] == "gp"])
    np.testing.assert_allclose(k, [1.0, 1.96])
    np.testing.assert_allclose(share, [0.09, 0.6])
    shown = texts(figures.calibration(table), tmp_path)
    assert {"gp (n = 2)", "raw (n = 1)", "normal", "k (stated SDs)", "Within k SD (%)"} <= set(shown)
    assert "where a normal distribution has 95 %: gp 60 %, raw 60 %" in figures.calibration.words(table).caption


def test_many_sessions_are_a_band_of_nine_in_ten(tmp_path: Path) -> None:
    rows = [row for n in range(1001) for row in counts("gp", f"s{n}", {100: n % 101, 196: 100}, 100)]
    table = tables.frame("calibration", rows)
    k, low, high = nine_of_ten(table)
    np.testing.assert_allclose(k, [1.0, 1.96])
    np.testing.assert_allclose(low, np.percentile([n % 101 for n in range(1001)], 5) * np.array([1, 0]) + [0, 100])
    np.testing.assert_allclose(high, np.percentile([n % 101 for n in range(1001)], 95) * np.array([1, 0]) + [0, 100])
    path = saved(figures.calibration(table), tmp_path)
    assert "nine of ten sessions" in texts(figures.calibration(table), tmp_path)
    assert "band: nine of ten sessions" in figures.calibration.words(table).caption
    assert path.stat().st_size < 200_000


def test_errors_that_are_far_apart_have_powers_of_ten_beneath_them(tmp_path: Path) -> None:
    far = figures.lag_and_error(accuracy(one=([5.0] * 3, [0.1] * 3), two=([900.0] * 3, [0.1] * 3)))
    assert {"10", "100", "1000"} <= set(texts(far, tmp_path))
    assert not {"200", "500"} & set(texts(far, tmp_path))
    near = figures.lag_and_error(accuracy(one=([5.0] * 3, [0.1] * 3), two=([90.0] * 3, [0.1] * 3)))
    assert {"10", "50", "100"} <= set(texts(near, tmp_path))

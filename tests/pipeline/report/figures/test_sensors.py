"""A few seconds of a session: streams, estimates with their errors, leads and noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline.report import figures
from pipeline.report.figures.excerpts import errors_in
from pipeline.tables import table as tables
from tests.pipeline.report.figures.drawn import saved, texts


def signal(kind: str, name: str, time: np.ndarray, value: np.ndarray, sd: float | None = None) -> pd.DataFrame:
    rows = pd.DataFrame({"time_s": time, "value": value}).assign(kind=kind, name=name, sd=sd, session="P1_a", axis="x")
    return tables.as_table("excerpts", rows)


@pytest.fixture
def excerpts() -> pd.DataFrame:
    frames, instants = np.arange(2.0, 6.0, 1 / 30), np.arange(2.0, 6.0, 1 / 90)
    return pd.concat(
        [
            signal("tracker", "tracker", frames, 100 * frames + 5),
            signal("reference", "reference", instants, 100 * instants),
            signal("acceleration", "imu", instants, np.sin(instants)),
            signal("estimate", "late", instants, 100 * (instants - 0.1), 20.0),
            signal("estimate", "good", instants, 100 * instants + 1, 0.25),
        ]
    )


def test_streams_name_their_units_and_how_many_readings_there_are(excerpts: pd.DataFrame, tmp_path: Path) -> None:
    shown = texts(figures.streams(excerpts), tmp_path)
    assert {"Position, x (mm)", "tracker, as it arrives (n = 120)", "acceleration (n = 360)", "reference"} <= set(shown)
    assert "Time since the session's start (s)" in shown
    said = figures.streams.words(excerpts)
    assert "session P1_a, axis x, 2.0 to 6.0 s" in said.caption
    assert "on arrival a frame is 5.0 mm (RMS) off the reference" in said.caption


def test_streams_alone(excerpts: pd.DataFrame, tmp_path: Path) -> None:
    frames = excerpts[excerpts["kind"] == "tracker"]
    assert len(figures.streams(frames).axes) == 1
    assert "reference" not in texts(figures.streams(frames), tmp_path)
    assert "off the reference" not in figures.streams.words(frames).caption


def test_estimates_stand_beside_their_errors(excerpts: pd.DataFrame, tmp_path: Path) -> None:
    _, error, _ = errors_in(excerpts, "late")
    np.testing.assert_allclose(error, -10.0)
    figure = figures.estimates(excerpts)
    assert len(figure.axes) == 4
    shown = texts(figure, tmp_path)
    assert {
        "late",
        "good",
        "error: RMS 10.0 mm in this stretch",
        "error: RMS 1.0 mm in this stretch",
        "x (mm)",
        "error (mm)",
    } <= set(shown)
    said = figures.estimates.words(excerpts).caption
    assert "good 1.0 mm, 0 % within ± 2 SD; late 10.0 mm, 100 % within ± 2 SD" in said


def test_estimates_without_reference_or_overlap(excerpts: pd.DataFrame, tmp_path: Path) -> None:
    alone = excerpts[excerpts["kind"] != "reference"]
    assert len(figures.estimates(alone).axes) == 2
    assert "RMS" not in figures.estimates.words(alone).caption
    elsewhere = excerpts.assign(time_s=excerpts["time_s"].where(excerpts["kind"] != "reference", 900.0))
    assert "error: unknown" in texts(figures.estimates(elsewhere), tmp_path)
    assert "nan" not in figures.estimates.words(elsewhere).caption


def test_a_band_that_is_still_wide_does_not_flatten_the_errors(excerpts: pd.DataFrame) -> None:
    began = excerpts.copy()
    late = (began["name"] == "late") & (began["time_s"] < 2.1)
    began.loc[late, "sd"] = 1e4
    assert figures.estimates(began).axes[1].get_ylim()[1] < 100


def test_two_estimators_stand_on_one_axis_and_minus_the_reference_below(excerpts: pd.DataFrame, tmp_path: Path) -> None:
    figure = figures.overlay(excerpts, "late", "good")
    above, below = figure.axes
    assert {"late", "good", "reference", "Minus reference"} <= set(texts(figure, tmp_path))
    lines = [np.asarray(line.get_ydata(), dtype=np.float64) for line in below.lines]
    np.testing.assert_allclose(lines[1], -10.0)
    np.testing.assert_allclose(lines[2], 1.0)
    assert len(above.collections) == 3  # the frames and two bands
    assert "late 10.0 mm and good 1.0 mm" in figures.overlay.words(excerpts, "late", "good").caption


def test_without_a_reference_nothing_stands_below(excerpts: pd.DataFrame) -> None:
    alone = excerpts[excerpts["kind"] != "reference"]
    assert len(figures.overlay(alone, "late", "good").axes) == 1
    assert "reference" not in figures.overlay.words(alone, "late", "good").caption


def curve(name: str, peak_s: float) -> pd.DataFrame:
    lead = np.arange(-45, 46) / 90
    rows = pd.DataFrame({"lead_s": lead, "correlation_mm2": 100 - (lead - peak_s) ** 2})
    return tables.as_table("lead_curves", rows.assign(session="P1_a", estimator=name))


def test_the_peaks_of_the_lead_are_named(tmp_path: Path) -> None:
    curves = pd.concat([curve("fusion", 10 / 90), curve("raw", 0.0), curve("off", 3.0), curve("late", -9 / 90)])
    shown = texts(figures.lead(curves, {}), tmp_path)
    assert {"fusion: peak at +111 ms", "raw: peak at 0 ms", "late: peak at −100 ms", "off"} <= set(shown)
    assert any("(ms)" in text for text in shown)
    said = figures.lead.words(curves, {}).caption
    assert "fusion +111 ms; raw 0 ms; off has no peak within half a second; late −100 ms" in said
    assert "Lag:" not in said
    beside = figures.lead.words(curves, {"raw": 0.114, "fusion": 0.002}).caption
    assert "fusion +111 ms (lag +2 ms); raw 0 ms (lag +114 ms);" in beside
    saved(figures.lead(curves.assign(correlation_mm2=0.0), {}), tmp_path)


def test_noise_names_unit_number_and_tails(tmp_path: Path) -> None:
    values = np.array([-1.0, 1.0] * 50)
    residuals = pd.DataFrame({"stream": ["tracker"] * 100 + ["still"] * 5, "residual": [*values, *[0.0] * 5]})
    units = pd.Series({"tracker": "mm", "still": "mm/s²", "none": "mm"})
    shown = texts(figures.noise(residuals, units), tmp_path)
    assert {"Reading − slow drift (mm)", "Reading − slow drift (mm/s²)"} <= set(shown)
    assert any(text.startswith("tracker: SD 1 mm") for text in shown)
    said = figures.noise.words(residuals, units).caption
    assert "tracker: SD 1.0 mm, n = 100, 0.0 % beyond 3 SD" in said
    assert "none: SD 0.0 mm, n = 0" in said

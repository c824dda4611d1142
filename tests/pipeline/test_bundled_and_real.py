"""The bundled studies come out as printed; others' recordings agree with an independent implementation."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from fusion_core.accuracy import interpolate, rmse
from pipeline.engine.stage import Work
from pipeline.sessions import ingest, recording
from pipeline.sessions.estimators import build_estimator
from pipeline.study.folder import load_study
from pipeline.study.session_files import find_sessions
from pipeline.tables import table as tables
from tests.conftest import CLONE, real
from tests.pipeline.helpers import Steadyhand, run
from tests.pipeline.report.pages import checked


@pytest.mark.usefixtures("blank_figures", "blank_print", "one_cache")
def test_feng2016_reproduces_what_the_paper_prints(steadyhand: Steadyhand) -> None:
    """48 of 49 figures to the last printed digit; the 49th contradicts the paper's own means."""
    ran = steadyhand("report", CLONE / "studies" / "feng2016")
    assert ran.code == 0
    rows = steadyhand.results()["printed"]
    verdicts = [row["verdict"] for row in rows]
    assert verdicts.count("agrees") == 48
    assert [row["what"] for row in rows if row["verdict"] == "differs"] == [
        "NASA-TLX, Kinect: total over participants and scales"
    ]
    contradictions = [row for row in rows if row["verdict"] == "contradiction"]
    assert [(row["printed"], row["computed"]) for row in contradictions] == [
        ("619", "621"),
        ("p = 0.0508, called significant", "not significant"),
    ]
    page = (steadyhand.out / "report.html").read_text(encoding="utf-8")
    text = " ".join("".join(checked(page).text).split())  # statistics are set in italics, without breaks within
    for printed in ("38.3 %", "26.7 %", "610.44", "479.32", "44.21", "32.41", "F(1, 11) = 10.86", "F(1, 11) = 12.05"):
        assert printed in text
    for printed in (".0071", ".0052", ".0137", ".0898", ".0508", ".0249", ".1611", ".0195"):
        assert f">{printed}<" in page or f"p = {printed}" in text
    assert "Reconstructed data" in page
    for title in ("Contradictions within the publication", "What a reader of the publication should know"):
        assert title in page


@pytest.mark.usefixtures("one_cache")
def test_reach_shows_what_the_first_experiment_shows(steadyhand: Steadyhand) -> None:
    """Fusion beats positions alone by about as much as the paper says (35.8 %), and is not late."""
    assert steadyhand("compare", CLONE / "studies" / "reach").code == 0
    errors = means(steadyhand.results()["accuracy"])
    assert 0.30 < 1 - errors["fusion"] / errors["gp"] < 0.60
    assert errors["kalman_fusion"] < 0.5 * errors["fusion"]
    for row in steadyhand.results()["accuracy"]:
        if row["estimator"] in ("gp", "fusion", "kalman_fusion"):
            assert abs(row["lag_s"]) < 0.05
        if row["estimator"] in ("raw", "kalman"):
            assert row["lag_s"] == pytest.approx(0.1, abs=0.04)


@pytest.mark.parametrize("study", ["feng2016", "reach"])
def test_the_bundled_studies_come_out_as_accepted(
    study: str, capsys: Any, monkeypatch: Any, cache_of_module: Path
) -> None:
    """The tests above have computed them already; here they are held against what was accepted."""
    options = ("--cache", str(cache_of_module), "--jobs", "1")
    ran = run(capsys, monkeypatch, "check", CLONE / "studies" / study, *options)
    assert ran.code == 0, ran.out


def means(rows: list[dict[str, Any]]) -> dict[str, float]:
    found: dict[str, list[float]] = {}
    for row in rows:
        found.setdefault(row["estimator"], []).append(row["rmse_mm"])
    return {name: sum(values) / len(values) for name, values in found.items()}


INDEPENDENT = {
    # raw, window_gp of positions, window_gp fused: RMSE in mm by an independent, slow implementation
    "phone-in-hand": {
        "P01_iphone4s": (39.8, 48.3, 24.9),
        "P02_iphone4s": (30.4, 47.8, 25.0),
        "P03_nexus5": (28.4, 47.3, 25.6),
    },
    "broad-translation": {
        "P01_slow": (73.5, 51.9, 29.9),
        "P01_breaks": (216.6, 189.3, 181.1),
    },
}


@pytest.mark.usefixtures("blank_figures", "blank_print")
@pytest.mark.parametrize("study", list(INDEPENDENT))
def test_accuracy_on_real_recordings_agrees_with_an_independent_implementation(
    study: str, steadyhand: Steadyhand
) -> None:
    folder = real(study)
    assert steadyhand("report", folder).code == 0
    found = {(row["session"], row["estimator"]): row for row in steadyhand.results()["accuracy"]}
    for session, expected in INDEPENDENT[study].items():
        for estimator, rmse_mm in zip(("raw", "gp", "fusion"), expected, strict=True):
            assert found[session, estimator]["rmse_mm"] == pytest.approx(rmse_mm, rel=0.02)
        assert found[session, "kalman_fusion"]["rmse_mm"] <= 0.45 * found[session, "fusion"]["rmse_mm"]
        assert 0.90 <= found[session, "kalman_fusion"]["coverage_95"] <= 0.99


def changed(study: str, tmp_path: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """A copy of a real study, its settings changed."""
    source, copy = real(study), tmp_path / study
    copy.mkdir()
    settings = yaml.safe_load((source / "study.yaml").read_text())
    change(settings)
    (copy / "study.yaml").write_text(yaml.safe_dump(settings))
    shutil.copytree(source / "data", copy / "data")
    return copy


def test_calibration_on_the_first_30_s_pays_on_the_rest(tmp_path: Path) -> None:
    def change(settings: dict[str, Any]) -> None:
        settings["streams"]["imu"]["calibrate_s"] = 30
        settings["estimators"] = {name: settings["estimators"][name] for name in ("fusion", "kalman_fusion")}

    copy = changed("phone-in-hand", tmp_path, change)
    study, errors = load_study(copy), {}
    for session in find_sessions(copy, study).sessions:
        out = tmp_path / session.id
        out.mkdir()
        ingest.run(Work("t", study, copy, out, (session,)))
        loaded = recording.load(study, out)
        assert loaded.mounted is not None and loaded.reference is not None
        late = loaded.times[loaded.times > loaded.mounted.from_s]
        truth = interpolate(loaded.reference, late)
        known = np.isfinite(truth).all(axis=1)
        window = build_estimator(study, "fusion").replay(loaded.samples, late).mean
        fused = recording.show(study, "kalman_fusion", loaded, late).mean
        errors[session.id] = rmse(fused[known], truth[known]) / rmse(window[known], truth[known])
    assert len(errors) == 3
    assert max(errors.values()) <= 0.37, errors


@pytest.mark.parametrize("study", list(INDEPENDENT))
def test_with_the_orientation_withheld_it_is_found(study: str, tmp_path: Path) -> None:
    folder = real(study)
    settings = load_study(folder)
    for session in find_sessions(folder, settings).sessions:
        out = tmp_path / session.id
        out.mkdir()
        ingest.run(Work("t", settings, folder, out, (session,)))
        window_mm = INDEPENDENT[study][session.id][2]
        imu = tables.read("imu", out)
        imu[["qx", "qy", "qz", "qw"]] = np.nan
        tables.write("imu", tables.as_table("imu", imu), out)
        loaded = recording.load(settings, out)
        assert loaded.phones["imu"].origins["in_log"] == 0
        assert loaded.reference is not None
        times = loaded.times[loaded.times >= loaded.samples["tracker"].arrival[0] + 1.0]
        truth = interpolate(loaded.reference, times)
        known = np.isfinite(truth).all(axis=1)
        fused = recording.show(settings, "kalman_fusion", loaded, times).mean
        assert rmse(fused[known], truth[known]) <= 0.7 * window_mm, session.id


@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_vr_pointing_agrees_with_r(steadyhand: Steadyhand) -> None:
    """F, epsilon, p and effect size as R's afex gives them on participant means."""
    assert steadyhand("report", real("vr-pointing")).code == 0
    omnibus = [row for row in steadyhand.results()["comparisons"] if row["contrast"] is None]
    rows = {row["measure"]: row for row in omnibus if row["test"] == "rm_anova"}
    error, time = rows["selection_mse_mm2"], rows["trial_time_s"]
    assert (error["df1"], error["df2"]) == (3, 45)
    assert error["statistic"] == pytest.approx(7.2175, abs=5e-5)
    assert error["details"]["epsilon_gg"] == pytest.approx(0.6959, abs=5e-5)
    assert error["details"]["p_gg"] == pytest.approx(0.00236, abs=5e-6)
    assert error["effect_size"] == pytest.approx(0.2175, abs=5e-5)
    assert time["statistic"] == pytest.approx(101.7708, abs=5e-5)
    assert time["details"]["epsilon_gg"] == pytest.approx(0.6496, abs=5e-5)
    assert time["details"]["p_gg"] == pytest.approx(8.66e-14, rel=1e-3)

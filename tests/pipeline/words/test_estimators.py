"""Estimators in words: one for each, and settings that a paper's reader can read."""

from __future__ import annotations

import re

from fusion_core import ESTIMATORS, FusionAdaptive, FusionKalman, PositionKalman, Sensor, WindowGP
from pipeline.words.estimators import ESTIMATOR_WORDS, settings_in_words

SENSORS = {"tracker": Sensor("position", 8.0, 0.1), "imu": Sensor("acceleration", 100.0)}


def test_every_estimator_has_words_of_its_own() -> None:
    assert set(ESTIMATOR_WORDS) == set(ESTIMATORS)
    assert len(set(ESTIMATOR_WORDS.values())) == len(ESTIMATORS)


def test_no_setting_is_named_as_in_the_program() -> None:
    for kind in (PositionKalman, WindowGP, FusionKalman, FusionAdaptive):
        for words in settings_in_words(kind(SENSORS)).values():
            assert not re.search(r"_|\bmm2\b|\bNone\b", words), words
    assert settings_in_words(FusionKalman(SENSORS))["jerk_psd_mm2_s5"] == "jerk PSD 1e7 mm²/s⁵"

"""The table `sensors_found`: what an estimator that finds its sensors says of them, beside study.yaml."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fusion_core import FusionAdaptive
from fusion_core.adaptive.found import Found
from pipeline.sessions.estimators import build_estimator
from pipeline.sessions.recording import Recording, in_pieces
from pipeline.study.settings import Study
from pipeline.tables.table import Row

_OF_THE_TRACKER = ("tracker_noise", "tracker_late")
_NOWHERE_STATED = "lever_arm"


def sensors_found_rows(study: Study, session: str, loaded: Recording) -> Iterator[Row]:
    """One row per figure of each estimator of that kind, by the end of the session."""
    for name in study.estimators:
        estimator = build_estimator(study, name)
        if not isinstance(estimator, FusionAdaptive):
            continue
        (phone,) = (stream for stream in estimator.sensors if stream != estimator.tracker)
        stated_mm = estimator.sensors[estimator.tracker].noise_sd
        for figure in _found(study, name, loaded, estimator):
            of_tracker = figure.quantity in _OF_THE_TRACKER
            stated = stated_mm if figure.quantity == "tracker_noise" else 0.0
            yield {
                "session": session,
                "estimator": name,
                "stream": estimator.tracker if of_tracker else phone,
                "quantity": figure.quantity,
                "unit": figure.unit,
                "value": figure.value,
                "ci_low": figure.ci_low,
                "ci_high": figure.ci_high,
                "stated": None if figure.quantity.startswith(_NOWHERE_STATED) else stated,
            }


def _found(study: Study, name: str, loaded: Recording, estimator: FusionAdaptive) -> list[Found]:
    pieces = in_pieces(study, name, loaded, np.zeros(0))
    if pieces is None:
        return estimator.found(loaded.samples)
    *_, (_, state) = pieces
    return estimator.found_by(state)

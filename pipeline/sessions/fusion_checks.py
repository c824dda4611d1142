"""Does fusion do what it is for? Checks of a session that need its tracks, beside those of its readings alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from fusion_core import Raw, Samples, accuracy
from pipeline.sessions.checks.finding import Finding, Status, graded, of, rows_of
from pipeline.sessions.estimators import fusing, sensors
from pipeline.sessions.recording import Recording, where_judged
from pipeline.study.settings import Study
from pipeline.tables.table import Row
from pipeline.words.accuracy_reference import SMOOTHED

USED, WORSE = "accelerations used", "fusion against tracker"
_LEFT_OUT = 0.01  # of the accelerations
_WORSE = (1.0, 1.5)  # times the tracker's own error


def fusion_check_rows(
    study: Study,
    session: str,
    loaded: Recording,
    reference: tuple[str, Samples] | None,
    rows: Sequence[Row],
) -> list[Row]:
    """Rows of the table `checks`; `rows` are the session's of `accuracy`."""
    rmse_mm = {str(row["estimator"]): float(row["rmse_mm"]) for row in rows}
    return rows_of([*used(loaded), *against_tracker(study, loaded, reference, rmse_mm)], session)


def used(loaded: Recording) -> Iterator[Finding]:
    """How many accelerations had a known orientation; without one an acceleration says nothing of where it points."""
    for name, phone in loaded.phones.items():
        total = phone.left_out + sum(phone.origins.values())
        if not total:
            continue
        share = phone.left_out / total
        status: Status = "red" if share == 1 else "amber" if share > _LEFT_OUT else "green"
        message = ""
        if status != "green":
            what = (
                f'not one acceleration of "{name}" could be used, so every estimate here is the tracker\'s alone'
                if share == 1
                else f'{phone.left_out} of {total} accelerations of "{name}" were left out'
            )
            message = (
                f"{what}: their orientation is not known; log the phone's orientation, or a gyroscope and some movement"
            )
        yield Finding(of(USED, name), status, f"{total - phone.left_out} of {total}", "all", message)


def against_tracker(
    study: Study, loaded: Recording, reference: tuple[str, Samples] | None, rmse_mm: Mapping[str, float]
) -> Iterator[Finding]:
    """Each fusing estimator's error against that of its tracker as it arrives. Needs a recorded reference.

    Where another one helps with the same readings, these do not contradict study.yaml: no more than amber.
    """
    alone_mm = _tracker_alone_mm(study, loaded, reference)
    if alone_mm is None:
        return
    rated = [name for name in fusing(study) if name in rmse_mm]
    helping = [name for name in rated if rmse_mm[name] <= alone_mm]
    for name in rated:
        status = graded(rmse_mm[name], _WORSE[0] * alone_mm, _WORSE[1] * alone_mm)
        message = ""
        if status != "green":
            status = "amber" if helping else status
            how = f"{name} is {rmse_mm[name]:.3g} mm off and its tracker alone {alone_mm:.3g}"
            message = f"{how}: {_cause(name, helping)}"
        yield Finding(of(WORSE, name), status, f"{rmse_mm[name]:.3g} mm", f"{alone_mm:.3g} mm", message)


def _cause(name: str, helping: Sequence[str]) -> str:
    if helping:
        return (
            f"its settings do not suit the movement, for {helping[0]} does better than the tracker with the same"
            f" readings; change the settings of {name}, or show people {helping[0]}"
        )
    return (
        f"noise, latency, gravity or orientation are not as stated, or the settings of {name} do not suit the movement;"
        " put the other checks right, then try steadyhand fit"
    )


def _tracker_alone_mm(study: Study, loaded: Recording, reference: tuple[str, Samples] | None) -> float | None:
    """RMSE in mm of the tracker's last frame, held, on the grid of accuracy."""
    tracker = study.tracker
    if reference is None or reference[0] == SMOOTHED or tracker is None:
        return None
    judged = where_judged(study, loaded, reference, loaded.times)
    if judged is None:
        return None
    on_grid, truth = judged
    samples = {tracker: loaded.samples[tracker]}
    held = Raw({tracker: sensors(study)[tracker]}).replay(samples, loaded.times[on_grid]).mean
    known = np.isfinite(held).all(axis=1)
    return accuracy.rmse(held[known], truth[known]) if known.any() else None

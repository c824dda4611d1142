"""Does fusion do what it is for? Checks of a session that need its tracks, beside those of its readings alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fusion_core import FusionAdaptive, Raw, Samples
from fusion_core.accuracy import squared_distances
from pipeline.sessions.checks.finding import Finding, Status, of, rows_of
from pipeline.sessions.estimators import fusing, sensors
from pipeline.sessions.growing import Growing
from pipeline.sessions.judged import judged
from pipeline.sessions.recording import Recording, Tracked
from pipeline.statistics.arrays import FloatArray
from pipeline.study.settings import Study
from pipeline.tables.table import Row
from pipeline.words.accuracy_reference import SMOOTHED

USED, WORSE = "accelerations used", "fusion against tracker"
_ADAPTIVE = "fusion_adaptive"
_LEFT_OUT = 0.01  # of the accelerations
_PLAIN, _RED = 1.15, 1.5  # times the tracker's own error; between 1 and the first, an interval decides
_BLOCK_S = 2.0  # errors of instants further apart than a reach have little to do with each other
_BLOCKS_MIN = 4


@dataclass(frozen=True)
class _Beside:
    """An estimator's RMSE and its tracker's at the same instants, in mm; is it larger, by much or beyond chance?"""

    rmse_mm: float
    alone_mm: float
    clearly_worse: bool


def fusion_check_rows(
    study: Study,
    session: str,
    loaded: Recording,
    reference: tuple[str, Samples] | None,
    tracks: Mapping[str, Tracked],
) -> list[Row]:
    """Rows of the table `checks`."""
    return rows_of([*used(loaded), *against_tracker(study, loaded, reference, tracks)], session)


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
    study: Study, loaded: Recording, reference: tuple[str, Samples] | None, tracks: Mapping[str, Tracked]
) -> Iterator[Finding]:
    """Each fusing estimator's error against that of its tracker's last frame, held. Needs a recorded reference.

    Where another one helps with the same readings, nothing contradicts study.yaml: the row is green and its message
    says so. A small difference that blocks of two seconds do not agree on may be chance: green without a message.
    """
    compared = {}
    for name in fusing(study):
        if name in tracks and (beside := _beside_tracker(study, loaded, reference, tracks[name])) is not None:
            compared[name] = beside
    helping = [name for name, one in compared.items() if one.rmse_mm <= one.alone_mm]
    for name, one in compared.items():
        status: Status = "green"
        message = ""
        if one.clearly_worse:
            if not helping:
                status = "red" if one.rmse_mm > _RED * one.alone_mm else "amber"
            how = f"{name} is {one.rmse_mm:.3g} mm off and its tracker alone {one.alone_mm:.3g}"
            message = f"{how}: {_cause(study, name, helping)}"
        expected = f"{one.alone_mm:.3g} mm" + (f", or {helping[0]} to be better" if message and helping else "")
        yield Finding(of(WORSE, name), status, f"{one.rmse_mm:.3g} mm", expected, message)


def _cause(study: Study, name: str, helping: Sequence[str]) -> str:
    if helping:
        return (
            f"its settings do not suit the movement, for {helping[0]} does better than the tracker with the same"
            f" readings; change the settings of {name}, or show people {helping[0]}"
        )
    finds_out = ""
    if study.estimators[name].type != _ADAPTIVE and _takes_the_sensors(study):
        finds_out = f", or an estimator of type {_ADAPTIVE}, which finds these out from the readings"
    return (
        f"noise, latency, gravity or orientation are not as stated, or the settings of {name} do not suit the movement;"
        f" put the other checks right, then try steadyhand fit{finds_out}"
    )


def _takes_the_sensors(study: Study) -> bool:
    """Can the adaptive filter be built for the study's sensors? It knows itself which it takes."""
    try:
        FusionAdaptive(sensors(study))
    except ValueError:
        return False
    return True


def _beside_tracker(
    study: Study, loaded: Recording, reference: tuple[str, Samples] | None, tracked: Tracked
) -> _Beside | None:
    """None without a recorded reference where the estimate is; accuracy is judged at the same instants."""
    tracker = study.tracker
    if reference is None or reference[0] == SMOOTHED or tracker is None:
        return None
    samples, raw = {tracker: loaded.samples[tracker]}, Raw({tracker: sensors(study)[tracker]})
    of_estimate, of_tracker, times = Growing(np.float64), Growing(np.float64), Growing(np.float64)
    for time, mean, _, truth in judged(study, loaded, reference, tracked):
        held = raw.replay(samples, time).mean
        estimated, alone = (squared_distances(one, truth) for one in (mean, held))
        known = np.isfinite(estimated) & np.isfinite(alone)
        of_estimate.add(estimated[known])
        of_tracker.add(alone[known])
        times.add(time[known])
    if not len(times):
        return None
    estimated, alone = of_estimate.whole(), of_tracker.whole()
    rmse_mm, alone_mm = (float(np.sqrt(np.mean(one))) for one in (estimated, alone))
    slightly = alone_mm < rmse_mm <= _PLAIN * alone_mm
    beyond_chance = slightly and _above_zero(estimated - alone, times.whole())
    return _Beside(rmse_mm, alone_mm, rmse_mm > _PLAIN * alone_mm or beyond_chance)


def _above_zero(difference: FloatArray, time: FloatArray) -> bool:
    """Is the mean above 0 beyond chance? By a t interval of blocks' means; without enough of them nobody can tell."""
    block = np.floor((time - time[0]) / _BLOCK_S).astype(np.int64)
    count = np.bincount(block)
    there = count > count.max() / 2
    means = np.bincount(block, difference)[there] / count[there]
    if len(means) < _BLOCKS_MIN:
        return False
    from pipeline.statistics.tails import t_quantile  # a tenth of what a process imports that computes sessions

    half = float(t_quantile(0.975, len(means) - 1) * np.std(means, ddof=1) / np.sqrt(len(means)))
    return float(np.mean(means)) - half > 0

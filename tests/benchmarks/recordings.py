"""Estimators on recordings that anyone can fetch: a hundred of phones and hand-held sensors, under every departure.

`python -m tests.benchmarks.recordings --phones FOLDER --sensors FOLDER [--departures | --together N]` takes clones of
github.com/tyrex-team/benchmarks-attitude-smartphones (Michel et al. 2017) and github.com/dlaidig/broad (Laidig et al.
2021). A minute of each is used; the tracker is made of the optical reference, as in `departures`. A phone's clock is
brought to the optics' by how fast both turn, and its accelerometer's, which may differ by some ms, by the size of the
specific force. Nothing here passes or fails.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.io import loadmat
from scipy.signal import correlate, savgol_filter
from scipy.spatial.transform import Rotation, Slerp

from fusion_core import Estimator, FusionAdaptive, PositionKalman, Raw
from fusion_core.samples import FloatArray, Samples
from tests.benchmarks.departures import DEPARTURES, G_MM_S2, SENSORS, Departure, Recorded, Source, recorded
from tests.benchmarks.stress import ESTIMATORS, Score, score
from tests.benchmarks.told import interpolated, rmse_mm

KINDS = {
    "phones held, texting, phoning": ("AR", "Texting", "Phoning"),
    "phones swung": ("Swinging",),
    "phones run with": ("RunningHand",),
    "sensor moved to and fro": ("_translation",),
    "sensor turned": ("_rotation",),
    "sensor, both, tapped, shaken": ("combined", "_disturbed"),
}
_PEOPLE, _PHONES, _FIELDS = ("Guillaume", "Jakob", "Thibaud"), ("Nexus5", "iPhone4S", "iPhone5"), ("NoDist", "Dist")
_SETTLED_S, _STILL_S, _SECONDS = 15.0, 3.0, 60.0
_STEP_S, _FINE_S = 0.002, 0.06
_MISALIGNED_DEG = 20.0  # a phone that seems turned so far in its holder was not brought to the optics' time
_GAP_S = 0.1
_FEWEST = 100  # instants of a part that is worth a figure
_TOO_SURE = 0.9  # where a 95 % interval holds less, it is named

Optics = tuple[FloatArray, FloatArray, FloatArray]
"""Times (n,) in s, positions (n, 3) in mm and rotations (n, 3, 3) where both are known."""


def phones(folder: Path) -> Iterator[Source]:
    """The phones that were held, swung and run with; where turning did not tell the time, none."""
    for motion in (motion for kind in list(KINDS.values())[:3] for motion in kind):
        for name in (f"{who}_{phone}_{field}_{motion}" for phone in _PHONES for who in _PEOPLE for field in _FIELDS):
            if (folder / "datasets" / "qualisys" / f"{name}.mat").is_file():
                source = _phone(folder / "datasets", name)
                if source is not None:
                    begin = source.time[0] + _SETTLED_S
                    yield source.between(begin, begin + _SECONDS)


def _phone(folder: Path, name: str) -> Source | None:
    ios = "iPhone" in name
    own = folder / ("ios" if ios else "android") / name
    force, turning = (
        np.loadtxt(own / f"{kind}.txt", usecols=range(4))
        for kind in ("accelerometer", "gyroscope" if ios else "gyroscope-calibrated")
    )
    optics, every = _qualisys(folder / "qualisys" / f"{name}.mat")
    middle, turns = _turning(optics, every)
    shift = _shift(middle, np.linalg.norm(turns, axis=1), turning[:, 0], np.linalg.norm(turning[:, 1:], axis=1))
    value = force[:, 1:] * (-G_MM_S2 if ios else 1000.0)
    late = _late_by_force(optics, every, force[:, 0] - shift, value)
    gyroscope = interpolated(turning[:, 0] - shift, turning[:, 1:], middle)
    turned, _ = Rotation.align_vectors(turns, gyroscope)
    if np.degrees(turned.magnitude()) > _MISALIGNED_DEG:
        print(f"  {name} left out: its clock could not be told from how it turned")
        return None
    time = force[:, 0] - shift - late
    return _source(name, time, value, interpolated(turning[:, 0] - shift, turning[:, 1:], time), optics, every)


def _qualisys(path: Path) -> tuple[Optics, float]:
    """The rigid body that is the phone, and the seconds between two frames."""
    (whole,) = (value for name, value in loadmat(path, simplify_cells=True).items() if not name.startswith("__"))
    body, every = whole["RigidBodies"], 1.0 / float(whole["FrameRate"])
    position, rotation = body["Positions"].T, body["Rotations"].T.reshape(-1, 3, 3).transpose(0, 2, 1)
    known = np.isfinite(position).all(axis=1) & np.isfinite(rotation).all(axis=(1, 2))
    return (every * np.flatnonzero(known).astype(np.float64), position[known], rotation[known]), every


def _turning(optics: Optics, every: float) -> tuple[FloatArray, FloatArray]:
    """Angular velocities (m, 3) in rad/s between neighbouring frames, and the times in the middle."""
    time, _, matrix = optics
    rotation = Rotation.from_matrix(matrix)
    beside = np.diff(time) < 1.5 * every
    speed = (rotation[:-1].inv() * rotation[1:]).as_rotvec() / np.diff(time)[:, None]
    return ((time[1:] + time[:-1]) / 2)[beside], speed[beside]


def _shift(time: FloatArray, value: FloatArray, other_time: FloatArray, other: FloatArray) -> float:
    """How much later than `time` the other clock is, by the highest correlation within 20 s of both beginnings."""
    first, second = (
        np.interp(np.arange(at[0], at[-1], _STEP_S), at, what) for at, what in ((time, value), (other_time, other))
    )
    correlation = correlate(second - second.mean(), first - first.mean(), method="fft")
    lag = (np.arange(len(correlation)) - (len(first) - 1)) * _STEP_S
    near = np.abs(lag) < 20.0 + time[0]
    return float(lag[near][np.argmax(correlation[near])] + other_time[0] - time[0])


def _late_by_force(optics: Optics, every: float, time: FloatArray, force: FloatArray) -> float:
    """How much later than the gyroscope's the accelerometer's stamps are, by the size of the specific force."""
    at, position, _ = optics
    whole = np.arange(at[0], at[-1], every)
    width = int(0.12 / every) // 2 * 2 + 1
    place = interpolated(at, position, whole)
    acceleration = savgol_filter(place, max(width, 7), 3, deriv=2, delta=every, axis=0)
    acceleration[:, 2] += G_MM_S2
    known = np.isin(np.round(whole / every), np.round(at / every))
    sure = np.convolve(known, np.ones(2 * width + 1), "same") > 2 * width
    expected, felt = np.linalg.norm(acceleration, axis=1)[sure], np.linalg.norm(force, axis=1)
    lags = np.arange(-_FINE_S, _FINE_S + _STEP_S / 2, _STEP_S)
    seen = [np.convolve(np.interp(whole + lag, time, felt), np.ones(5) / 5, "same")[sure] for lag in lags]
    return float(lags[np.argmax([np.corrcoef(one, expected)[0, 1] for one in seen])])


def sensors(folder: Path) -> Iterator[Source]:
    """The hand-held sensor, three readings in one, from three seconds before it moves."""
    for path in sorted((folder / "data_mat").glob("*.mat")):
        whole = loadmat(path, simplify_cells=True)
        if not any(word in path.stem for words in list(KINDS.values())[3:] for word in words):
            continue
        every = 1.0 / float(whole["sampling_rate"])
        position, quaternion = 1000.0 * whole["opt_pos"], np.roll(whole["opt_quat"], -1, axis=1)
        known = np.isfinite(position).all(axis=1) & np.isfinite(quaternion).all(axis=1)
        rotation = Rotation.from_quat(quaternion[known]).as_matrix()
        optics = (every * np.flatnonzero(known).astype(np.float64), position[known], rotation)
        count = len(position) // 3 * 3
        force, turning = (whole[name][:count].reshape(-1, 3, 3).mean(axis=1) for name in ("imu_acc", "imu_gyr"))
        time = (np.arange(count) * every).reshape(-1, 3).mean(axis=1)
        moves = np.flatnonzero(whole["movement"])[0] * every
        source = _source(path.stem, time, 1000.0 * force, turning, optics, every)
        yield source.between(moves - _STILL_S, moves - _STILL_S + _SECONDS)


def _source(
    name: str, time: FloatArray, force: FloatArray, turning: FloatArray, optics: Optics, every: float
) -> Source:
    at, position, matrix = optics
    within = (time >= at[0]) & (time <= at[-1])
    following = np.searchsorted(at, time).clip(1, len(at) - 1)
    known = within & (at[following] - at[following - 1] < 1.5 * every)
    quaternion = np.full((len(time), 4), np.nan)
    quaternion[known] = Slerp(at, Rotation.from_matrix(matrix))(time[known]).as_quat()
    gravity = np.array([0.0, 0.0, -G_MM_S2])
    heard = time[within], time[within] + 0.002, force[within], turning[within], quaternion[within]
    return Source(name, *heard, Samples(at, at, position), gravity)


def _without_gaps(whole: Recorded, source: Source) -> Recorded:
    """The instants at which the optics saw the phone."""
    at = source.reference.time
    following = np.searchsorted(at, whole.times).clip(1, len(at) - 1)
    seen: npt.NDArray[np.bool_] = at[following] - at[following - 1] < _GAP_S
    return replace(whole, times=whole.times[seen], truth=whole.truth[seen])


def as_stated(sources: list[Source]) -> None:
    """Geometric means of RMSE by kind of motion, how often the adaptive filter's 95 % interval holds, and its RMSE
    over that of a filter that is told whatever lasts (the median)."""
    print(f"  {'':<32}" + "".join(f"{name:>16}" for name in ESTIMATORS) + "   95 % holds, least   over told")
    for kind, words in KINDS.items():
        scores: dict[str, list[Score]] = {name: [] for name in ESTIMATORS}
        told: list[float] = []
        for source in (one for one in sources if any(word in one.name for word in words)):
            whole = _without_gaps(recorded(source, DEPARTURES["as stated"]), source)
            for name, estimator in ESTIMATORS.items():
                scores[name].append(score(estimator, whole, source.reference))
            told.append(rmse_mm(source, whole))
        holds = [one.coverage for one in scores["fusion_adaptive"]]
        if holds:
            cells = "".join(f"{_geometric([one.rmse_mm for one in of]):>16.1f}" for of in scores.values())
            over = np.median([one.rmse_mm / other for one, other in zip(scores["fusion_adaptive"], told, strict=True)])
            held = f"{np.mean(holds):.3f} {min(holds):.2f}   {over:.2f}"
            print(f"  {f'{kind} ({len(holds)})':<32}{cells}   {held}", flush=True)


def under_departures(sources: list[Source]) -> None:
    """Each departure: RMSE and coverage of the adaptive filter, and how it compares with positions alone."""
    names: Mapping[str, Estimator] = {
        "fusion_adaptive": FusionAdaptive(SENSORS),
        "raw": Raw(SENSORS),
        "kalman": PositionKalman(SENSORS),
    }
    print(f"  {'':<32}{'RMSE':>8}{'95 %':>8}{'least':>8}{'worst of raw':>14}  worse than positions alone")
    for departure in DEPARTURES:
        rows, worse = [], []
        for source in sources:
            whole = _without_gaps(recorded(source, DEPARTURES[departure]), source)
            if not len(whole.times):
                worse.append(f"{source.name} left out: no heading was ever found")
                continue
            own, raw, alone = (score(one, whole, source.reference) for one in names.values())
            ratio = own.rmse_mm / min(raw.rmse_mm, alone.rmse_mm)
            rows.append((own.rmse_mm, own.coverage, ratio))
            worse += [f"{source.name} {ratio:.2f}"] if ratio > 1.0 else []
        rmse, holds, ratio_of = np.array(rows).T
        figures = f"{_geometric(rmse):>8.1f}{holds.mean():>8.3f}{holds.min():>8.2f}{ratio_of.max():>14.2f}"
        print(f"  {departure:<32}{figures}  {', '.join(worse)}", flush=True)


def together(sources: list[Source], count: int) -> None:
    """Parts of 15 to 60 s under two to four departures at once, drawn at random: where it loses, or says too little."""
    rows, known = [], [name for name in DEPARTURES if name != "as stated"]
    for seed in range(count):
        random = np.random.default_rng(seed)
        source = sources[random.integers(len(sources))]
        seconds = random.uniform(15.0, _SECONDS)
        begin = source.time[0] + random.uniform(0.0, max(np.ptp(source.time) - seconds, 0.0))
        part = source.between(begin, begin + seconds)
        names = list(random.choice(known, random.integers(2, 5), replace=False))
        whole = _without_gaps(recorded(part, _at_once(names), seed), part)
        if len(whole.times) < _FEWEST:
            continue
        own, *alone = (score(kind(SENSORS), whole, part.reference) for kind in (FusionAdaptive, Raw, PositionKalman))
        rows.append((own.rmse_mm / min(one.rmse_mm for one in alone), own.coverage))
        if rows[-1][0] > 1.0 or rows[-1][1] < _TOO_SURE:
            print(f"  {source.name}, {', '.join(names)}: {rows[-1][0]:.2f}, {rows[-1][1]:.2f}", flush=True)
    ratio, holds = np.array(rows).T
    print(
        f"{len(rows)} parts: {np.median(ratio):.2f} times the better of raw and position_kalman (median), worse in"
        f" {np.sum(ratio > 1.0)}, at the most {ratio.max():.2f} times; its 95 % interval holds {holds.mean():.3f},"
        f" under {_TOO_SURE:.0%} in {np.sum(holds < _TOO_SURE)}"
    )


def _at_once(names: list[str]) -> Departure:
    """Several departures; of two that are of one kind, the later."""
    usual, changed = asdict(DEPARTURES["as stated"]), dict[str, Any]()
    for name in names:
        changed |= {key: value for key, value in asdict(DEPARTURES[name]).items() if value != usual[key]}
    return Departure(**changed)


def _geometric(values: list[float] | FloatArray) -> float:
    return float(np.exp(np.mean(np.log(values))))


def main() -> None:
    """As the module says."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--phones", type=Path, metavar="FOLDER")
    asked.add_argument("--sensors", type=Path, metavar="FOLDER")
    asked.add_argument("--departures", action="store_true", help="every departure, on every fourth recording")
    asked.add_argument("--together", type=int, metavar="N", help="N parts of recordings, several departures at once")
    given = asked.parse_args()
    sources = list(phones(given.phones)) if given.phones else []
    sources += list(sensors(given.sensors)) if given.sensors else []
    print(f"{len(sources)} recordings of {_SECONDS:g} s, RMSE in mm")
    if given.departures:
        under_departures(sources[1::4])
    elif given.together:
        together(sources, given.together)
    else:
        as_stated(sources)


if __name__ == "__main__":
    main()

"""The stress table: every departure, every estimator; error, coverage and lag.

`python -m tests.benchmarks.stress [--table FILE.md] [--picture FILE.svg] [--seconds N]` takes the recordings of
STEADYHAND_STUDIES (default ../shared/studies), and a simulated one where they are absent. Nothing here passes or fails.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fusion_core import Estimator, FusionAdaptive, FusionKalman, Holt, OneEuro, PositionKalman, Raw, WindowGP
from fusion_core.accuracy import lag
from fusion_core.samples import FloatArray, Samples
from tests.benchmarks.departures import DEPARTURES, SENSORS, Recorded, Source, recorded, simulated
from tests.conftest import CLONE

ESTIMATORS: Mapping[str, Estimator] = {
    "raw": Raw(SENSORS),
    "one_euro": OneEuro(SENSORS),
    "holt": Holt(SENSORS),
    "position_kalman": PositionKalman(SENSORS),
    "window_gp": WindowGP(SENSORS),
    "fusion_kalman": FusionKalman(SENSORS),
    "fusion_adaptive": FusionAdaptive(SENSORS),
}
_STUDIES = ("phone-in-hand", "broad-translation")


@dataclass(frozen=True)
class Score:
    """One estimator on one recording: 3-D RMSE in mm, share of axes within 1.96 SD, lag in s."""

    rmse_mm: float
    coverage: float
    lag_s: float


def sources(seconds: float) -> Iterator[Source]:
    """The recordings there are, each its first `seconds`."""
    root = Path(os.environ.get("STEADYHAND_STUDIES", CLONE.parent / "shared" / "studies"))
    found = False
    for study in _STUDIES:
        if (root / study).is_dir():
            found = True
            yield from (source.until(seconds) for source in _of_study(root / study))
    if not found:
        yield simulated(seconds)


def _of_study(folder: Path) -> Iterator[Source]:
    """Each session of a study as a source: the phone as logged, and the reference."""
    from pipeline.engine.cache import Cache
    from pipeline.engine.processes import InThisProcess
    from pipeline.engine.progress import PlainLines
    from pipeline.engine.resources import Resources
    from pipeline.engine.run import bring_up_to_date
    from pipeline.sessions import recording
    from pipeline.stages import INGEST
    from pipeline.tables import table as tables
    from pipeline.tables.columns import S_PER_NS

    with tempfile.TemporaryDirectory() as cache:
        result = bring_up_to_date(folder, INGEST, Resources(Cache(Path(cache)), InThisProcess(), PlainLines()))
        for session, entry in result.entries["ingest"].items():
            loaded = recording.load(result.study, entry.folder)
            rows = tables.of_stream(tables.read_arrow("imu", entry.folder), "imu")
            stamp, arrival = ((rows[name] - loaded.origin_ns) * S_PER_NS for name in ("time_ns", "arrival_ns"))
            force, turning, quaternion = (
                np.column_stack([rows[name] for name in names])
                for names in (
                    ("ax_mm_s2", "ay_mm_s2", "az_mm_s2"),
                    ("gx_rad_s", "gy_rad_s", "gz_rad_s"),
                    ("qx", "qy", "qz", "qw"),
                )
            )
            assert loaded.reference is not None
            gravity = np.array(result.study.streams["imu"].gravity_mm_s2)  # type: ignore[union-attr]
            yield Source(session, stamp, arrival, force, turning, quaternion.astype(float), loaded.reference, gravity)


def score(estimator: Estimator, whole: Recorded, reference: Samples) -> Score:
    """An estimator on a recording, from a second after the first frame on."""
    track = estimator.replay(whole.samples, whole.times)
    error = track.mean - whole.truth
    late = lag(whole.times, track.mean, reference, np.random.default_rng(0)).value
    return Score(
        float(np.sqrt(np.mean(np.sum(error**2, axis=1)))),
        float(np.mean(np.abs(error) <= 1.96 * track.sd)),
        late,
    )


def table(seconds: float) -> dict[str, dict[str, dict[str, Score]]]:
    """By recording, departure and estimator, printed as it goes."""
    found: dict[str, dict[str, dict[str, Score]]] = {}
    for source in sources(seconds):
        print(f"{source.name}: RMSE in mm (coverage) lag in ms, {seconds:g} s", flush=True)
        print(f"  {'':<32}" + "".join(f"{name:>22}" for name in ESTIMATORS))
        found[source.name] = {}
        for name, departure in DEPARTURES.items():
            whole = recorded(source, departure)
            scores = {kind: score(one, whole, source.reference) for kind, one in ESTIMATORS.items()}
            found[source.name][name] = scores
            cells = (f"{s.rmse_mm:.1f} ({s.coverage:.2f}) {1e3 * s.lag_s:+.0f}" for s in scores.values())
            print(f"  {name:<32}" + "".join(f"{cell:>22}" for cell in cells), flush=True)
    return found


def as_markdown(found: Mapping[str, Mapping[str, Mapping[str, Score]]]) -> str:
    """The geometric mean of errors over recordings, and of `fusion_adaptive` the coverage, mean and least."""
    lines = ["| | " + " | ".join(f"`{name}`" for name in ESTIMATORS) + " | its 95 % holds | least |"]
    lines.append("|---|" + "---|" * (len(ESTIMATORS) + 2))
    for name in DEPARTURES:
        errors = {kind: np.array([one[name][kind].rmse_mm for one in found.values()]) for kind in ESTIMATORS}
        held = 100 * np.array([one[name]["fusion_adaptive"].coverage for one in found.values()])
        cells = [f"{np.exp(np.mean(np.log(error))):.1f}" for error in errors.values()]
        lines.append(f"| {name} | " + " | ".join(cells) + f" | {held.mean():.0f} % | {held.min():.0f} % |")
    return "\n".join([*lines, ""])


def draw(found: Mapping[str, Mapping[str, Mapping[str, Score]]], path: Path) -> None:
    """Error relative to raw, the geometric mean over recordings, of each departure."""
    import matplotlib as mpl

    mpl.use("svg")
    from matplotlib import pyplot as plt

    names = list(DEPARTURES)
    shown = {
        "position_kalman": ("s", "#999999"),
        "window_gp": ("^", "#D55E00"),
        "fusion_kalman": ("x", "#CC79A7"),
        "fusion_adaptive": ("o", "#0072B2"),
    }
    figure, axes = plt.subplots(figsize=(6.3, 8.2), layout="constrained")
    for kind, (marker, colour) in shown.items():
        ratio = [_relative(found, name, kind) for name in names]
        axes.semilogx(ratio, np.arange(len(names)), marker, color=colour, markersize=5, label=kind)
    axes.axvline(1.0, color="black", linewidth=0.8)
    axes.set_yticks(np.arange(len(names)), names, fontsize=8)
    axes.invert_yaxis()
    axes.set_xticks([0.1, 0.2, 0.5, 1, 2], ["0.1", "0.2", "0.5", "1", "2"])
    axes.minorticks_off()
    axes.set_xlabel("Error over that of the tracker as it comes\n(geometric mean over recordings)")
    figure.legend(frameon=False, fontsize=8, loc="outside upper center", ncols=len(shown))
    axes.grid(axis="y", linewidth=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    mpl.rcParams["svg.hashsalt"] = "departures"
    figure.savefig(path, metadata={"Date": None})


def _relative(found: Mapping[str, Mapping[str, Mapping[str, Score]]], name: str, kind: str) -> float:
    ratios: FloatArray = np.array([one[name][kind].rmse_mm / one[name]["raw"].rmse_mm for one in found.values()])
    return float(np.exp(np.mean(np.log(ratios))))


def stress() -> None:
    """The table of the recordings' first minute."""
    print(as_markdown(table(60.0)))


def main() -> None:
    """Print, and write what is asked for."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--picture", type=Path)
    wanted = parser.parse_args()
    found = table(wanted.seconds)
    if wanted.table:
        wanted.table.write_text(as_markdown(found), encoding="utf-8")
    if wanted.picture:
        draw(found, wanted.picture)


if __name__ == "__main__":
    main()

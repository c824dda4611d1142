"""What `fit` says of a reference's frame and clock, by the movement that it and the tracker recorded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from pipeline.sessions import recording
from pipeline.sessions.checks.agreement import lag_text
from pipeline.sessions.frames import Frame, frame_of, on_the_rest, until
from pipeline.statistics.arrays import FloatArray
from pipeline.study.settings import Study
from pipeline.study.streams import ReferenceStream
from pipeline.words.phrases import counted

_LAG_OFF_S = 0.02  # an interval that is nearer to what is stated says nothing


def lines(study: Study, entries: Mapping[str, Path], first_s: float) -> Iterator[str]:
    """The block for study.yaml, or why there is none; nothing for a study without tracker or reference."""
    name, tracker = study.stream_of_kind("reference"), study.tracker
    if name is None or tracker is None:
        return
    stated = study.streams[name]
    assert isinstance(stated, ReferenceStream)  # noqa: S101 - that is its kind
    sessions = {
        session: (seen, known)
        for session, entry in entries.items()
        for seen, known in [recording.in_space(study, entry, tracker, name)]
    }
    frame = frame_of(until(sessions, first_s))
    if frame is None:
        yield (
            f"# streams.{name}: its frame cannot be found: in the first {first_s:g} s of no session does it show a"
            f" movement in common with {tracker}"
        )
        return
    if not frame.told:
        yield (
            f"# streams.{name}: its frame cannot be found from this movement (the turn is known to"
            f" ± {frame.turn_half_deg:.0f}°); move along all three axes"
        )
    else:
        yield from _frame(name, stated, frame, on_the_rest(sessions, frame, first_s))
    yield from _clocks(name, tracker, frame)


def _frame(name: str, stated: ReferenceStream, frame: Frame, rest_mm: tuple[float, float] | None) -> Iterator[str]:
    """Proposed only where it is beyond its own interval and no worse on the rest."""
    before_mm, after_mm = rest_mm or (0.0, 0.0)
    turned = f"turned by {frame.turn_deg:.2f} ± {frame.turn_half_deg:.2f}°"
    moved = f"moved by {frame.shift_mm:.1f} ± {frame.shift_half_mm:.1f} mm from what is stated"
    yield f"# streams.{name} against the tracker, by {counted(len(frame.lags_s), 'session')}: {turned}, {moved};"
    yield f"#   {frame.left_mm:.1f} mm RMS are left between the two"
    if rest_mm is not None:
        yield f"#   median distance on the rest of each session: {before_mm:.1f} -> {after_mm:.1f} mm"
    if frame.turn_deg <= frame.turn_half_deg and frame.shift_mm <= frame.shift_half_mm:
        yield "#   which agrees with study.yaml"
        return
    if after_mm > before_mm:
        yield "#   which is worse than what study.yaml states, so that was kept"
        return
    rotation, translation_mm = _composed(stated, frame)
    yield "streams:"
    yield f"  {name}:"
    yield f"    rotation_xyzw: [{', '.join(f'{part:.5f}' for part in rotation)}]"
    yield f"    translation_mm: [{', '.join(f'{part:.1f}' for part in translation_mm)}]"


def _composed(stated: ReferenceStream, frame: Frame) -> tuple[FloatArray, FloatArray]:
    """What study.yaml states, followed by the frame that was found: as a quaternion and a translation."""
    from scipy.spatial.transform import Rotation

    first, then = Rotation.from_quat(stated.rotation_xyzw), Rotation.from_matrix(frame.rotation)
    return (then * first).as_quat(canonical=True), frame.applied(np.array([stated.translation_mm]))[0]


def _clocks(name: str, tracker: str, frame: Frame) -> Iterator[str]:
    """Sessions whose two clocks disagree."""
    for session, lag_s in frame.lags_s.items():
        if min(abs(lag_s.low), abs(lag_s.high)) > _LAG_OFF_S and lag_s.low * lag_s.high > 0:
            yield (
                f"# {session}: {tracker} is {lag_text(lag_s)} later than {name}, after what study.yaml says of both:"
                " latency_s of one of the two, or its clock, is off by as much"
            )

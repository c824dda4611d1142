"""What an attempt shows on the phone, and what the phone says that it has drawn."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.live import lever_arm
from pipeline.live.changes import changed
from pipeline.live.events import NOTHING, Show, Write
from pipeline.live.outgoing import Shown
from pipeline.live.session_state import Estimate, PhoneDrew, Session, Stepped
from pipeline.live.session_words import DRAWN, record
from pipeline.sessions.logs.mcap import Message
from pipeline.tables.columns import S_PER_NS

_UNDER_WAY = 2
_REMEMBERED = 64  # estimates: a selection names one of the last
_M_PER_MM = 1e-3


def show(state: Session, at_ns: int) -> Stepped:
    """Send the phone an estimate for now, if it can take one and there is one."""
    if state.phone is None or state.origin_ns is None:
        return state, NOTHING
    if len(state.under_way) >= _UNDER_WAY:
        return changed(state, waiting=True), NOTHING
    instant = max(at_ns, state.clock_ns + 1)
    mean, _ = state.attempt.estimator.predict(state.estimated, (instant - state.origin_ns) * S_PER_NS)
    if not np.isfinite(mean).all():
        return state, NOTHING
    estimate = Estimate(state.n + 1, instant, tuple((mean + lever_arm.now(state)).tolist()))
    state = changed(
        state,
        n=estimate.n,
        clock_ns=instant,
        shown_ns=instant,
        waiting=False,
        sent=(*state.sent[1 - _REMEMBERED :], estimate),
        under_way=(*state.under_way, estimate.n),
    )
    x, y = (estimate.mean_mm[list(state.attempt.axes).index(axis)] for axis in "xy")
    assert state.phone is not None  # noqa: S101
    return state, (Show(state.phone, Shown(estimate.n, x, y, state.trial), instant),)


def drew(state: Session, event: PhoneDrew) -> Stepped:
    """What was drawn is what was displayed."""
    estimate = sent(state, event.n)
    if estimate is None or event.n <= state.drawn:
        return state, NOTHING
    state = changed(state, drawn=event.n, under_way=tuple(n for n in state.under_way if n > event.n))
    drawn_ns = min(max(event.drawn_ns, estimate.instant_ns), max(event.at_ns, estimate.instant_ns))
    written = (
        Write(Message(state.attempt.display_topic, "position", estimate.instant_ns, drawn_ns, metres(state, estimate))),
        record(DRAWN, drawn_ns, {"n": event.n, "drawn_at": drawn_ns}),
    )
    if not state.waiting:
        return state, written
    state, shown = show(state, event.at_ns)
    return state, (*written, *shown)


def sent(state: Session, n: int) -> Estimate | None:
    """Estimate `n`, if it is one of the last."""
    return next((one for one in reversed(state.sent) if one.n == n), None)


def metres(state: Session, estimate: Estimate) -> Any:
    """The position (3,) in m, 0 on axes that are not analysed."""
    place = dict(zip(state.attempt.axes, estimate.mean_mm, strict=True))
    return np.array([place.get(axis, 0.0) for axis in "xyz"]) * _M_PER_MM

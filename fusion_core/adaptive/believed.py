"""Which orientations are believed: one that turns faster than any hand was lost, and is wrong until it is back.

A phone's orientation may come from optics that take other markers for the phone's, or from a compass beside iron. An
acceleration turned by a wrong orientation is off by as much as twice gravity: such a reading says less than none.
"""

from __future__ import annotations

import numpy as np

from fusion_core.adaptive.layout import (
    HAS_TURNED,
    LOST,
    LOST_SINCE,
    NEW_S,
    ORIENTATION,
    ORIENTED,
    ROTATION,
    TIME,
    TURNED_S,
    Model,
    State,
)
from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray

_FASTEST_RAD_S = 35.0  # 2000° a second: as far as gyroscopes of phones go
_AT_ONCE_RAD = 0.1  # of stamps that are off by some ms
_REPEATED_S = 0.03  # a new orientation comes so often, or the phone rests
_BACK_RAD, _BACK_RAD_S = 0.5, 3.0  # as near to where it was lost, and for each second since: then it is back
_LOST_S = 0.3  # what stays so long is where the phone is, for all that is known


@compiled(inner=True)
def is_believed(model: Model, state: State, reading: FloatArray) -> bool:
    """Can a hand have turned the phone to a reading's orientation since the last one that was believed?

    An orientation may be found less often than readings are logged, and be repeated in between. Of one axis or two it
    is known how far they have turned, which is at most as far as the phone.
    """
    if reading[ORIENTATION] < ORIENTED:
        return True
    time, least, trace, same = reading[TIME], 1.0, 0.0, True
    for axis in range(model.dimension):
        of_axis = 0.0
        for at in range(3 * axis, 3 * axis + 3):
            of_axis += reading[ROTATION + at] * state.turned[at]
            same &= reading[ROTATION + at] == state.turned[at]
        least, trace = min(least, of_axis), trace + of_axis
    cosine = (trace - 1.0) / 2.0 if model.dimension == 3 else least
    if state.count[HAS_TURNED] and not same:
        angle, since = np.arccos(min(max(cosine, -1.0), 1.0)), max(time - state.fact[TURNED_S], 0.0)
        if state.count[LOST] == 0:
            state.fact[LOST_SINCE] = time
            since += min(state.fact[TURNED_S] - state.fact[NEW_S], _REPEATED_S)
            lost = angle > _AT_ONCE_RAD + _FASTEST_RAD_S * since
        else:
            lost = angle > _BACK_RAD + _BACK_RAD_S * since and time - state.fact[LOST_SINCE] < _LOST_S
        state.count[LOST] = 1 if lost else 0
        if lost:
            return False
    state.count[HAS_TURNED], state.count[LOST], state.fact[TURNED_S] = 1, 0, time
    if not same:
        state.fact[NEW_S] = time
    for at in range(9):
        state.turned[at] = reading[ROTATION + at]
    return True

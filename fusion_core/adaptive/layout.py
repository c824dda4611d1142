"""Where everything stands: the state's parts, the columns of rows and members, and the data that steps work on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusion_core.samples import FloatArray

# The large filter's state: where its parts begin.
POSITION, VELOCITY = 0, 3  # of the phone, in the tracker's frame
BIAS, MOUNTING, OFFSET, TURN = 6, 9, 12, 15  # what enters accelerations: `INPUTS` states in a row
ARM, DRIFT = 17, 20  # what enters positions: the lever arm, and correlated noise of the tracker
SIZE = 23
INPUTS = ARM - BIAS

# A row of the phone: acceleration in the tracker's frame (3), rotation (3, 3), rotation times force
# as a cross (3, 3), and
# the density of what is not known of the acceleration where a reading is clipped.
VALUE, TURNED, CROSSED, CLIPPED, ROW = 0, 3, 12, 21, 22
UNTURNED, ORIENTED, FELT = 0.0, 1.0, 2.0  # what is known of a row: nothing, its rotation, and also its force

# A member of the bank.
TRACKER_VARIANCE, ACCELERATION_PSD, RATE_PSD, USES_PHONE, DRIFT_VARIANCE, DRIFT_S, MEMBER = 0, 1, 2, 3, 4, 5, 6

# State.count.
ROWS, WAITING, TAKEN, TOO_LATE, KNOWS_ARM, HAS_DIFFERED, STRANGE = 0, 1, 2, 3, 4, 5, 6

# State.fact.
AT, BEGAN, STRANGE_SINCE, PHONE_AHEAD = 0, 1, 2, 3  # times in s; how far the phone's stamps are ahead of their arrival
NOISE, TRUST, NOISE_DRIFT, NOISE_DRIFT_S = 4, 5, 6, 7  # the scales as found
SCORED, SURPRISE = 8, 9  # how often what was shown was scored; its squared error, relative to what was stated
ERROR = 10  # and the squared errors of fusion, of positions gone on with, of positions held
CLOCK_S, CLOCK_VARIANCE, STAMP = 13, 14, 15  # how much later than its stamp a frame was measured; the newest stamp
LAST = 16  # the newest frame (3)
LARGEST = 19  # the largest component of specific force so far
STRANGE_MM = 20  # how far off the first strange frame was
AT_LARGEST = 21  # how often the largest component came again
FACTS = 22

# A row of State.shown: what fusion, positions gone on with and positions held would have shown (3 each), the mixture's
# position (3) and its variance as the filters state it.
FUSED, AHEAD, HELD, MIXED, STATED, SHOWN = 0, 3, 6, 9, 12, 13


class Model(NamedTuple):
    """What does not change. Variances and densities in mm and s."""

    dimension: int
    prior: FloatArray  # (SIZE,) variances before any reading
    walk: FloatArray  # (SIZE,) densities of the states that drift
    member: FloatArray  # (MEMBER, members): those that use the phone come first
    log_member: FloatArray  # (MEMBER, members): their logarithms, where there are any
    first_alone: int  # the first member that does not use the phone
    log_prior: FloatArray  # (members,)
    surprise: float  # the squared innovation beyond which a position counts for less
    history_s: float


class State(NamedTuple):
    """What is known. Arrays are changed in place; `count` and `fact` hold the single figures."""

    time: FloatArray  # (capacity,) of the rows, rising
    row: FloatArray  # (capacity, ROW)
    force: FloatArray  # (capacity, 4): force in the body's frame, and what is known of the row
    shown: FloatArray  # (capacity, SHOWN): NaN where nothing was
    count: npt.NDArray[np.int64]  # type: ignore[assignment]  # not a tuple's count
    fact: FloatArray
    mean: FloatArray  # (SIZE,)
    covariance: FloatArray  # (SIZE, SIZE)
    head: FloatArray  # (2, ROW): first and second integrals of the rows since the state
    bank_mean: FloatArray  # (12, members): three axes each of position, velocity, acceleration error, correlated noise
    bank_covariance: FloatArray  # (10, members): the triangle of that of any axis
    weight: FloatArray  # (members,): log likelihood with forgetting
    share: FloatArray  # (members,): by weight and prior
    kept: FloatArray  # (members,): of the correlated noise, over the last step
    clock_mean: FloatArray  # (offsets, 4, 3): as of a member of the bank
    clock_covariance: FloatArray  # (4, 4), of all
    clock_weight: FloatArray  # (offsets,)
    usual: FloatArray  # (3, 3 + INPUTS): slow averages of lever-arm and input couplings
    waiting: FloatArray  # (most, 5): time, arrival and value of frames not taken in yet


MOST_WAITING = 8
OFFSETS = 11  # of the tracker's clock, that are tried


def empty(model: Model, capacity: int) -> State:
    """Nothing known, and room for `capacity` rows of the phone."""
    members = model.member.shape[1]
    return State(
        np.zeros(capacity),
        np.zeros((capacity, ROW)),
        np.zeros((capacity, 4)),
        np.full((capacity, SHOWN), np.nan),
        np.zeros(7, np.int64),
        np.zeros(FACTS),
        np.zeros(SIZE),
        np.zeros((SIZE, SIZE)),
        np.zeros((2, ROW)),
        np.zeros((12, members)),
        np.zeros((10, members)),
        np.zeros(members),
        np.zeros(members),
        np.zeros(members),
        np.zeros((OFFSETS, 4, 3)),
        np.zeros((4, 4)),
        np.zeros(OFFSETS),
        np.zeros((3, 3 + INPUTS)),
        np.zeros((MOST_WAITING, 5)),
    )

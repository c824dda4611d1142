"""Where everything stands: the state's parts, the columns of rows and members, and the data that steps work on.

Model and state are records of NumPy, whose fields are arrays of fixed size. To compiled code a record is one address: a
tuple of as many arrays would be taken apart and counted at each call, which made compiling three times as long.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from fusion_core.samples import FloatArray

# The large filter's state: where its parts begin.
POSITION, VELOCITY = 0, 3  # of the phone, in the tracker's frame
BIAS, MOUNTING, OFFSET, TURN = 6, 9, 12, 15  # what enters accelerations: `INPUTS` states in a row
ARM, DRIFT = 17, 20  # what enters positions: the lever arm, and correlated noise of the tracker
SIZE = 23
INPUTS = ARM - BIAS

# A reading as it arrives: its times, whether it is the tracker's, what is known of its orientation, its value (3),
# rotation (3, 3) and specific force in the body's frame (3).
TIME, ARRIVAL, IS_FRAME, ORIENTATION, READ, ROTATION, SPECIFIC, READING = 0, 1, 2, 3, 4, 7, 16, 19
UNTURNED, ORIENTED, FELT = 0.0, 1.0, 2.0  # what is known: nothing, the rotation, and also the force

# A row of the phone: acceleration in the tracker's frame (3), rotation (3, 3), rotation times force as a cross (3, 3),
# and the density of what is not known of the acceleration where a reading is clipped. So far it is integrated; then
# follow the force in the body's frame (3) and what is known of the row.
VALUE, TURNED, CROSSED, CLIPPED, ROW = 0, 3, 12, 21, 22
FORCE, KNOWN, COLUMNS = 22, 25, 26

# Model.trusted: whose clock is right, of the tracker's and the phone's.
NEITHER, THE_PHONE, THE_TRACKER = 0, 1, 2

# A member of the bank.
TRACKER_VARIANCE, ACCELERATION_PSD, RATE_PSD, USES_PHONE, DRIFT_VARIANCE, DRIFT_S, MEMBER = 0, 1, 2, 3, 4, 5, 6

# State.count.
ROWS, WAITING, TAKEN, TOO_LATE, KNOWS_ARM, HAS_DIFFERED, STRANGE = 0, 1, 2, 3, 4, 5, 6
ASTRAY = 7  # frames in a row that the fusion alone did not expect
IN_A_ROW = 8  # frames that were measurements, since there was none for a while
HAS_TURNED, LOST = 9, 10  # is an orientation known, and is the newest one not believed
ELSEWHERE = 11  # are strange frames another body's, to which the tracker has leapt
COUNTS = 12

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
PACE = 22  # the mean squared speed of the hand, an axis
CLOCK_STEADY_S = 23  # as CLOCK_S, were the clock a steady one
SEEN, SEEN_S = 24, 27  # the newest frame that was a measurement (3), and when it was measured
TURNED_S, NEW_S = 28, 29  # when the newest orientation that is believed was logged, and when for the first time
LOST_SINCE = 30  # when those began that are not
UNSURE = 31  # what is not known of accelerations since the stamp, (mm/s)²: an integral of densities
LAST_S = 32  # when the newest frame was measured
FACTS = 33

# A row of Phone.shown: what fusion, positions gone on with and positions held would have shown (3 each), the mixture's
# position (3) and its variance as the filters state it.
FUSED, AHEAD, HELD, MIXED, STATED, SHOWN = 0, 3, 6, 9, 12, 13

MEMBERS = 81  # of the bank
OFFSETS = 21  # of the tracker's clock, that are tried
STEADY, WANDERING = 0, 1  # what kind of clock
OF_ARM = 4  # the row of a clock filter's mean that holds its lever arm
MOST_WAITING = 8


class Model(Protocol):
    """What does not change. Variances and densities in mm and s."""

    dimension: int
    trusted: int  # whose clock
    first_alone: int  # the first member that does not use the phone
    surprise: float  # the squared innovation beyond which a position counts for less
    history_s: float
    prior: FloatArray  # (SIZE,) variances before any reading
    walk: FloatArray  # (SIZE,) densities of the states that drift
    member: FloatArray  # (MEMBER, members): those that use the phone come first
    log_member: FloatArray  # (MEMBER, members): their logarithms, where there are any
    log_prior: FloatArray  # (members,)


class State(Protocol):
    """What is known, changed in place; `count` and `fact` hold the single figures."""

    count: npt.NDArray[np.int64]
    fact: FloatArray
    mean: FloatArray  # (SIZE,)
    covariance: FloatArray  # (SIZE, SIZE)
    head: FloatArray  # (2, ROW): first and second integrals of the rows since the state
    bank_mean: FloatArray  # (12, members): three axes each of position, velocity, acceleration error, correlated noise
    bank_covariance: FloatArray  # (10, members): the triangle of that of any axis
    weight: FloatArray  # (members,): log likelihood with forgetting
    share: FloatArray  # (members,): by weight and prior
    kept: FloatArray  # (members,): of the correlated noise, over the last step
    clock_mean: FloatArray  # (offsets, 5, 3): as of a member of the bank, and a lever arm
    clock_covariance: FloatArray  # (15, 15), of all: four of each axis, and the lever arm
    clock_weight: FloatArray  # (2, offsets): log likelihoods with forgetting, of a steady clock and of one that wanders
    clock_foretold: FloatArray  # (2,): log likelihood with forgetting, of the frames as each kind foretold them
    turned: FloatArray  # (9,): the newest orientation that is believed
    usual: FloatArray  # (3, 3 + INPUTS): slow averages of lever-arm and input couplings
    waiting: FloatArray  # (most + 1, 5): time, arrival and value of frames not taken in yet


class Phone(NamedTuple):
    """The phone's readings that are kept, rising in time; State.count says how many there are."""

    time: FloatArray  # (capacity,)
    row: FloatArray  # (capacity, COLUMNS)
    shown: FloatArray  # (capacity, SHOWN): what was shown when the row was the newest; NaN where nothing was
    corrected: FloatArray  # (capacity, 3): room for accelerations as the state corrects them


MODEL = np.dtype(
    [
        ("dimension", np.int64),
        ("trusted", np.int64),
        ("first_alone", np.int64),
        ("surprise", np.float64),
        ("history_s", np.float64),
        ("prior", np.float64, (SIZE,)),
        ("walk", np.float64, (SIZE,)),
        ("member", np.float64, (MEMBER, MEMBERS)),
        ("log_member", np.float64, (MEMBER, MEMBERS)),
        ("log_prior", np.float64, (MEMBERS,)),
    ]
)
STATE = np.dtype(
    [
        ("count", np.int64, (COUNTS,)),
        ("fact", np.float64, (FACTS,)),
        ("mean", np.float64, (SIZE,)),
        ("covariance", np.float64, (SIZE, SIZE)),
        ("head", np.float64, (2, ROW)),
        ("bank_mean", np.float64, (12, MEMBERS)),
        ("bank_covariance", np.float64, (10, MEMBERS)),
        ("weight", np.float64, (MEMBERS,)),
        ("share", np.float64, (MEMBERS,)),
        ("kept", np.float64, (MEMBERS,)),
        ("clock_mean", np.float64, (OFFSETS, 5, 3)),
        ("clock_covariance", np.float64, (15, 15)),
        ("clock_weight", np.float64, (2, OFFSETS)),
        ("clock_foretold", np.float64, (2,)),
        ("turned", np.float64, (9,)),
        ("usual", np.float64, (3, 3 + INPUTS)),
        ("waiting", np.float64, (MOST_WAITING + 1, 5)),
    ]
)
Records = npt.NDArray[Any]
"""One record of `MODEL` or `STATE`, as an array of shape (1,)."""


class Memory(NamedTuple):
    """A state and the phone's readings that it still needs."""

    state: Records
    phone: Phone


def empty(capacity: int) -> Memory:
    """Nothing known, and room for `capacity` rows of the phone."""
    return Memory(np.zeros(1, STATE), room(capacity))


def room(capacity: int) -> Phone:
    """Room for `capacity` rows."""
    return Phone(
        np.zeros(capacity), np.zeros((capacity, COLUMNS)), np.full((capacity, SHOWN), np.nan), np.zeros((capacity, 3))
    )

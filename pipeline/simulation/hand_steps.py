"""A simulated participant, compiled: what they see, where they want to go, how the hand moves, and when they press.

The participant sees only the display, with a visual delay, and knows what they planned for their own hand. There are
two models of movement: intermittent minimum-jerk plans (Flash and Hogan 1985, replanned after a refractory time) and a
second-order lag towards the goal. Everything is two-dimensional, in the plane of the canvas, in mm and s. All functions
are inlined, because passing the structures on would cost more than the steps themselves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.simulation.compilation import compiled
from pipeline.statistics.arrays import FloatArray

IntArray = npt.NDArray[np.int64]

STEP_S = 0.0025  # readings in between are interpolated: a hand's motion hardly curves within a step
_RING = 1024  # steps of memory, a power of two: more than any delay
_AVERAGED = 20  # steps over which the seen discrepancy is averaged
_MUSCLE_S = 0.04  # each of the two filters between motor noise and hand
_SEARCHED_POINTS = 100  # how many points of the path to either side are searched for one in view
_SEEN_MEAN_S = 0.15  # time constant of the leaky mean of the seen offset, which decides about a press
INTERMITTENT, SECOND_ORDER_LAG = 0, 1

# Where a participant stands in the task.
WAITING, MOVING, TAPPING, RESTING, DONE = 0, 1, 2, 3, 4


class Person(NamedTuple):
    """One participant's traits, as in study.yaml, and what they have learned of the display's lag."""

    model: int
    visual_delay_s: float
    refractory_s: float
    base_time_s: float
    time_per_sqrt_mm_s: float
    noise_along_sqrt_s: float
    noise_across_sqrt_s: float
    dwell_s: float
    press_radius_mm: float
    correction_s: float
    margin_mm: float
    resume_s: float
    tap_s: float
    patience_s: float
    slow_mm_s: float
    dead_zone_mm: float
    natural_frequency_rad_s: float
    damping_ratio: float
    expected_lag_s: float


class Layout(NamedTuple):
    """The task: a path by points a mm apart, targets in order and where on the path they are."""

    path_mm: FloatArray  # (n, 2); empty without a path
    targets_mm: FloatArray  # (k, 2)
    target_at: IntArray  # (k,): rows of the path
    half_window_mm: FloatArray  # (2,); infinite without a window
    radius_mm: FloatArray  # (k,): of the targets


class Sway(NamedTuple):
    """An involuntary motion: a resonator driven by low-passed noise, (position, velocity, drive) a step on."""

    transition: FloatArray  # (3, 3)
    drive_sd: float
    stiffness: float  # 1/s²
    damping: float  # 1/s


class Hand(NamedTuple):
    """A participant's state; all arrays are written in place."""

    planned: FloatArray  # (3, 2): position, velocity and acceleration as the participant knows them
    polynomial: FloatArray  # (6, 2) of the time since the plan began
    planned_to: FloatArray  # (2,)
    noise: FloatArray  # (3, 2): both filters' velocities, and the displacement
    tremor: FloatArray  # (3, 2)
    drift: FloatArray  # (3, 2)
    seen: FloatArray  # (ring, 2): the displayed position
    own: FloatArray  # (ring, 2): the planned position
    apart: FloatArray  # (ring, 2): the discrepancy
    summed: FloatArray  # (2,) of the newest discrepancies
    correction: FloatArray  # (2,)
    offset: FloatArray  # (2,): the leaky mean of goal less seen position
    goal: FloatArray  # (2,)
    clock: FloatArray  # see below
    progress: IntArray  # see below


# Columns of Hand.clock, in s.
_PLAN_BEGAN, _PLAN_LASTS, _AIMED_SINCE, _NEAR_FOR_S, _NEXT_AT = 0, 1, 2, 3, 4
# Columns of Hand.progress.
STEP, TARGET, PHASE, ALONG, _AIMING, _SEES_FROM, PLANS = 0, 1, 2, 3, 4, 5, 6


def hand_at(start_mm: FloatArray, begins_s: float) -> Hand:
    """A hand at rest that has seen nothing yet, and sets off at `begins_s`."""
    planned = np.zeros((3, 2))
    planned[0] = start_mm
    hand = Hand(
        planned,
        np.zeros((6, 2)),
        np.array(start_mm, dtype=np.float64),
        noise=np.zeros((3, 2)),
        tremor=np.zeros((3, 2)),
        drift=np.zeros((3, 2)),
        seen=np.zeros((_RING, 2)),
        own=np.zeros((_RING, 2)),
        apart=np.zeros((_RING, 2)),
        summed=np.zeros(2),
        correction=np.zeros(2),
        offset=np.zeros(2),
        goal=np.array(start_mm, dtype=np.float64),
        clock=np.zeros(5),
        progress=np.zeros(7, np.int64),
    )
    hand.own[:] = start_mm
    hand.clock[_PLAN_BEGAN], hand.clock[_NEXT_AT] = -np.inf, begins_s
    return hand


@compiled(forceinline=True)
def _steps(seconds: float) -> int:
    """The nearest number of steps; `round` would take as long as the rest of a step."""
    return int(seconds / STEP_S + 0.5)


@compiled(forceinline=True)
def sway(motion: Sway, state: FloatArray, axis: int, draw: float) -> None:
    position, velocity, drive = state[0, axis], state[1, axis], state[2, axis]
    for row in range(3):
        state[row, axis] = (
            motion.transition[row, 0] * position
            + motion.transition[row, 1] * velocity
            + motion.transition[row, 2] * drive
        )
    state[2, axis] += motion.drive_sd * draw


@compiled(forceinline=True)
def replan(person: Person, hand: Hand, to_x: float, to_y: float, now: float) -> None:
    """Plans a quintic from the planned motion now to rest at the goal, lasting T₀ + k·√distance."""
    goal = (to_x, to_y)
    distance = np.hypot(to_x - hand.planned[0, 0], to_y - hand.planned[0, 1])
    lasts = person.base_time_s + person.time_per_sqrt_mm_s * np.sqrt(distance)
    for axis in range(2):
        position, velocity = hand.planned[0, axis], hand.planned[1, axis] * lasts
        half = hand.planned[2, axis] * lasts * lasts / 2.0
        rest = goal[axis] - position - velocity - half
        slope, bend = -velocity - 2.0 * half, -2.0 * half
        hand.polynomial[0, axis], hand.polynomial[1, axis], hand.polynomial[2, axis] = position, velocity, half
        hand.polynomial[3, axis] = 10.0 * rest - 4.0 * slope + bend / 2.0
        hand.polynomial[4, axis] = -15.0 * rest + 7.0 * slope - bend
        hand.polynomial[5, axis] = 6.0 * rest - 3.0 * slope + bend / 2.0
        hand.planned_to[axis] = goal[axis]
    hand.clock[_PLAN_BEGAN], hand.clock[_PLAN_LASTS] = now, lasts
    hand.progress[PLANS] += 1


@compiled(forceinline=True)
def follow_plan(hand: Hand, now: float) -> None:
    """Sets the planned motion at `now`: along the polynomial, at rest after its end."""
    lasts = hand.clock[_PLAN_LASTS]
    part = (now - hand.clock[_PLAN_BEGAN]) / lasts if lasts > 0.0 else 1.0
    for axis in range(2):
        if part >= 1.0:
            hand.planned[0, axis] = hand.planned_to[axis]
            hand.planned[1, axis] = hand.planned[2, axis] = 0.0
            continue
        position, velocity, acceleration = 0.0, 0.0, 0.0
        for power in range(5, -1, -1):  # Horner's scheme, of the derivatives as well
            acceleration = acceleration * part + 2.0 * velocity
            velocity = velocity * part + position
            position = position * part + hand.polynomial[power, axis]
        hand.planned[0, axis] = position
        hand.planned[1, axis] = velocity / lasts
        hand.planned[2, axis] = acceleration / (lasts * lasts)


@compiled(forceinline=True)
def _follow_goal(person: Person, hand: Hand, to_x: float, to_y: float) -> None:
    """A step of a second-order lag towards the goal, by the mean of both ends' velocities."""
    goal, stiffness = (to_x, to_y), person.natural_frequency_rad_s**2
    damping = 2.0 * person.damping_ratio * person.natural_frequency_rad_s
    for axis in range(2):
        position, velocity = hand.planned[0, axis], hand.planned[1, axis]
        hand.planned[2, axis] = stiffness * (goal[axis] - position) - damping * velocity
        hand.planned[1, axis] = velocity + STEP_S * hand.planned[2, axis]
        hand.planned[0, axis] = position + STEP_S * (velocity + hand.planned[1, axis]) / 2.0
        hand.planned_to[axis] = goal[axis]


@compiled(forceinline=True)
def _perceive(person: Person, hand: Hand) -> None:
    """Updates the correction, which follows the seen position less the planned one, allowing for the expected lag."""
    step = hand.progress[STEP]
    delay = _steps(person.visual_delay_s)
    earlier = _steps(person.visual_delay_s + person.expected_lag_s)
    for axis in range(2):
        apart = hand.seen[(step - delay) & (_RING - 1), axis] - hand.own[(step - earlier) & (_RING - 1), axis]
        hand.summed[axis] += apart - hand.apart[(step - _AVERAGED) & (_RING - 1), axis]
        hand.apart[step & (_RING - 1), axis] = apart
        mean = hand.summed[axis] / _AVERAGED
        hand.correction[axis] += STEP_S / person.correction_s * (mean - hand.correction[axis])


@compiled(forceinline=True)
def _in_view(person: Person, layout: Layout, x: float, y: float, seen_x: float, seen_y: float) -> bool:
    return bool(
        abs(x - seen_x) <= layout.half_window_mm[0] - person.margin_mm
        and abs(y - seen_y) <= layout.half_window_mm[1] - person.margin_mm
    )


@compiled(forceinline=True)
def _farthest_in_view(person: Person, layout: Layout, along: int, last: int, seen_x: float, seen_y: float) -> int:
    """The farthest point of the path in view, going on from the nearest one in view; `along` itself if none is."""
    path, farthest = layout.path_mm, -1
    for away in range(_SEARCHED_POINTS):
        back, on = max(along - away, 0), min(along + away, last)
        if _in_view(person, layout, path[back, 0], path[back, 1], seen_x, seen_y):
            farthest = back
        elif _in_view(person, layout, path[on, 0], path[on, 1], seen_x, seen_y):
            farthest = on
        if farthest >= 0:
            break
    if farthest < 0:
        return along
    while farthest < last and _in_view(person, layout, path[farthest + 1, 0], path[farthest + 1, 1], seen_x, seen_y):
        farthest += 1
    return farthest


@compiled(forceinline=True)
def _aim(person: Person, layout: Layout, hand: Hand, now: float) -> None:
    """Sets the goal: the target if it is in view, otherwise the farthest point of the path in view."""
    step, target = hand.progress[STEP], hand.progress[TARGET]
    delay = _steps(person.visual_delay_s)
    seen_x, seen_y = hand.seen[(step - delay) & (_RING - 1), 0], hand.seen[(step - delay) & (_RING - 1), 1]
    target_x, target_y = layout.targets_mm[target, 0], layout.targets_mm[target, 1]
    path, last = layout.path_mm, layout.target_at[target]
    along = _farthest_in_view(person, layout, hand.progress[ALONG], last, seen_x, seen_y)
    hand.progress[ALONG] = along
    if hand.progress[_AIMING] == 0 and along >= last and _in_view(person, layout, target_x, target_y, seen_x, seen_y):
        hand.progress[_AIMING] = 1
        hand.clock[_AIMED_SINCE], hand.clock[_NEAR_FOR_S] = now, 0.0
        hand.offset[0], hand.offset[1] = target_x - seen_x, target_y - seen_y
    if hand.progress[_AIMING] == 1:
        hand.goal[0], hand.goal[1] = target_x, target_y
        for axis in range(2):
            offset = hand.goal[axis] - hand.seen[(step - delay) & (_RING - 1), axis]
            hand.offset[axis] += STEP_S / _SEEN_MEAN_S * (offset - hand.offset[axis])
    elif len(path) > 0:
        hand.goal[0], hand.goal[1] = path[along, 0], path[along, 1]


@compiled(forceinline=True)
def _press(person: Person, layout: Layout, hand: Hand, now: float) -> bool:
    """Whether the participant decides to press: the hand is slow, and has been near enough to the target for long."""
    if hand.progress[_AIMING] == 0:
        return False
    slow = np.hypot(hand.planned[1, 0], hand.planned[1, 1]) < person.slow_mm_s
    near = min(person.press_radius_mm, layout.radius_mm[hand.progress[TARGET]])
    allowed = near * (1.0 + (now - hand.clock[_AIMED_SINCE]) / person.patience_s)
    if slow and np.hypot(hand.offset[0], hand.offset[1]) < allowed:
        hand.clock[_NEAR_FOR_S] += STEP_S
    else:
        hand.clock[_NEAR_FOR_S] = 0.0
    return bool(hand.clock[_NEAR_FOR_S] >= person.dwell_s)


@compiled(forceinline=True)
def _decide(person: Person, layout: Layout, hand: Hand, now: float) -> bool:
    """Updates the phase of the task; returns True when the tap lands."""
    phase = hand.progress[PHASE]
    if phase == WAITING and now >= hand.clock[_NEXT_AT]:
        hand.progress[PHASE] = MOVING
    elif phase == MOVING:
        _aim(person, layout, hand, now)
        if _press(person, layout, hand, now):
            hand.progress[PHASE], hand.clock[_NEXT_AT] = TAPPING, now + person.tap_s
    elif phase == TAPPING and now >= hand.clock[_NEXT_AT]:
        hand.progress[PHASE], hand.clock[_NEXT_AT] = RESTING, now + person.resume_s
        return True
    elif phase == RESTING and now >= hand.clock[_NEXT_AT]:
        hand.progress[_AIMING] = 0
        hand.progress[TARGET] += 1
        hand.progress[PHASE] = DONE if hand.progress[TARGET] == len(layout.targets_mm) else MOVING
    return False


@compiled(forceinline=True)
def _move(person: Person, tremor: Sway, drift: Sway, hand: Hand, now: float, draws: np.random.Generator) -> None:
    """Moves the hand by a step: its plan, motor noise in proportion to speed, tremor and drift."""
    to_x, to_y = hand.goal[0] - hand.correction[0], hand.goal[1] - hand.correction[1]
    wants = hand.progress[PHASE] == MOVING
    if person.model == SECOND_ORDER_LAG:
        if wants:
            _follow_goal(person, hand, to_x, to_y)
        else:
            _follow_goal(person, hand, hand.planned_to[0], hand.planned_to[1])
    else:
        rested = now - hand.clock[_PLAN_BEGAN] >= person.refractory_s
        off = np.hypot(to_x - hand.planned_to[0], to_y - hand.planned_to[1])
        if wants and rested and off > person.dead_zone_mm:
            replan(person, hand, to_x, to_y, now)
        follow_plan(hand, now + STEP_S)
    speed = np.hypot(hand.planned[1, 0], hand.planned[1, 1])
    along, across = draws.standard_normal() / np.sqrt(STEP_S), draws.standard_normal() / np.sqrt(STEP_S)
    along, across = along * person.noise_along_sqrt_s, across * person.noise_across_sqrt_s
    drives = (
        hand.planned[1, 0] * along - hand.planned[1, 1] * across,
        hand.planned[1, 1] * along + hand.planned[1, 0] * across,
    )
    for axis in range(2):
        drive = drives[axis] if speed > 0.0 else 0.0
        before = hand.noise[1, axis]
        hand.noise[1, axis] += STEP_S / _MUSCLE_S * (hand.noise[0, axis] - before)
        hand.noise[0, axis] += STEP_S / _MUSCLE_S * (drive - hand.noise[0, axis])
        hand.noise[2, axis] += STEP_S * (before + hand.noise[1, axis]) / 2.0
        sway(tremor, hand.tremor, axis, draws.standard_normal())
        sway(drift, hand.drift, axis, draws.standard_normal())


@compiled(inner=True, forceinline=True)
def advance(
    person: Person,
    layout: Layout,
    tremor: Sway,
    drift: Sway,
    hand: Hand,
    displayed_x: float,
    displayed_y: float,
    draws: np.random.Generator,
    trace: FloatArray,
) -> bool:
    """One step with the display as it stands (NaN while there is none); True where a tap landed at its begin.

    Writes the hand's true position and acceleration (x, y, ax, ay) at the step's end into its row of `trace`.
    """
    step = hand.progress[STEP]
    now, known = step * STEP_S, not np.isnan(displayed_x)
    hand.seen[step & (_RING - 1), 0], hand.seen[step & (_RING - 1), 1] = displayed_x, displayed_y
    hand.own[step & (_RING - 1), 0], hand.own[step & (_RING - 1), 1] = hand.planned[0, 0], hand.planned[0, 1]
    tapped = False
    if not known:  # the eyes have not met the first display yet
        hand.progress[_SEES_FROM] = step + 1 + _steps(person.visual_delay_s)
    if step >= hand.progress[_SEES_FROM]:
        _perceive(person, hand)
        tapped = _decide(person, layout, hand, now)
    _move(person, tremor, drift, hand, now, draws)
    hand.progress[STEP] = step + 1
    for axis in range(2):
        involuntary = hand.noise[2, axis] + hand.tremor[0, axis] + hand.drift[0, axis]
        trace[step + 1, axis] = hand.planned[0, axis] + involuntary
        trace[step + 1, 2 + axis] = (
            hand.planned[2, axis]
            + (hand.noise[0, axis] - hand.noise[1, axis]) / _MUSCLE_S
            + _pull(tremor, hand.tremor, axis)
            + _pull(drift, hand.drift, axis)
        )
    return tapped


@compiled(forceinline=True)
def _pull(motion: Sway, state: FloatArray, axis: int) -> float:
    """A sway's acceleration."""
    return float(state[2, axis] - motion.damping * state[1, axis] - motion.stiffness * state[0, axis])

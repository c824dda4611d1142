"""One thing wrong in a copy of a log, each as a recorder, a driver or a study.yaml has done it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipeline.sessions.logs.log import Log
from pipeline.study.settings import Study
from tests.pipeline.sessions.checks.ways_to_spoil import (
    EVENTS,
    IMU,
    REFERENCE,
    TRACKER,
    Case,
    about,
    as_if_milliseconds,
    both,
    change,
    clock_steps,
    disclaimed,
    doubled_stamps,
    events,
    every_clock_back,
    faster_clock,
    force,
    found_anew,
    frame_changes,
    frozen,
    gravity,
    gyroscope,
    in_bursts,
    in_degrees,
    jittered,
    late_orientation,
    later,
    lost_as_held,
    lost_as_zeros,
    lost_now_and_then,
    nearly_w_first,
    of_length,
    orientation,
    placed,
    republished,
    seldom,
    settings,
    strays,
    swapped_targets,
    taken_for_another,
    thinned,
    twice,
    two_publishers,
    values,
    whole_seconds,
    without_gravity,
    without_orientation,
)


@dataclass(frozen=True)
class Fault:
    """What is wrong, the check that must say so, and words its message must contain."""

    name: str
    spoil: Callable[[Log, Study], Case]
    check: str
    says: str


MM = ("speed", "millimetres")
_ASIDE = np.array([0.3, 0.0, 0.0])
MEAN, LAG, FRAME = "mean acceleration", "lag", "frame of the movement"

FAULTS: tuple[Fault, ...] = (
    Fault("positions in mm", both(values(TRACKER, lambda v: v * 1e3), values(REFERENCE, lambda v: v * 1e3)), *MM),
    Fault("tracker in mm", values(TRACKER, lambda v: v * 1e3), "size of the movement", "millimetres"),
    Fault("reference in mm", values(REFERENCE, lambda v: v * 1e3), *MM),
    Fault("tracker in cm", values(TRACKER, lambda v: v * 1e2), "size of the movement", "centimetres"),
    Fault("accelerometer in g", force(lambda v: v / 9.80665), "specific force", "in g"),
    Fault("accelerometer in g, iOS sign", force(lambda v: -v / 9.80665), "specific force", "in g"),
    Fault("sign flipped", force(lambda v: -v), MEAN, "sign"),
    Fault("gravity removed", values(IMU, without_gravity), "specific force", "gravity seems removed"),
    Fault("gravity's sign", lambda log, study: gravity(log, study, -1), MEAN, "gravity_mm_s2"),
    Fault("gravity's axis", lambda log, study: gravity(log, study, 0), MEAN, "gravity_mm_s2"),
    Fault("gravity in m/s²", lambda log, study: gravity(log, study, 1e-3), "length of gravity", "m/s²"),
    Fault("phone 50 ms late", change(IMU, lambda r: later(r, 0.05)), LAG, "ms later"),
    Fault("phone 50 ms early", change(IMU, lambda r: later(r, -0.05)), LAG, "ms later"),
    Fault("phone 200 ms late", change(IMU, lambda r: later(r, 0.2)), LAG, "ms later"),
    Fault("stamped on arrival", settings("tracker", stamp="measurement", latency_s=0.0), LAG, "stamp: arrival"),
    Fault("latency twice the truth", settings("tracker", latency_s=0.2), LAG, "set latency_s: 0."),
    Fault("left-handed z", values(TRACKER, lambda v: v * [1, 1, -1]), FRAME, "mirror image"),
    Fault("left-handed x", values(TRACKER, lambda v: v * [-1, 1, 1]), FRAME, "mirror image"),
    Fault("tracker's x and y exchanged", values(TRACKER, lambda v: v[:, [1, 0, 2]]), FRAME, "exchanged"),
    Fault("tracker is y up", values(TRACKER, about("x", -90)), FRAME, "another order"),
    Fault("heading off by 90°", values(TRACKER, about("z", 90)), FRAME, "heading"),
    Fault("quaternion w first", orientation(lambda q: q[:, [3, 0, 1, 2]]), MEAN, "w, x, y, z"),
    Fault("quaternion inverted", orientation(lambda q: q * [-1, -1, -1, 1]), "gyroscope", "inverted"),
    Fault("orientation a placeholder", orientation(lambda q: q * 0 + [0, 0, 0, 1]), "gyroscope", "frozen"),
    Fault("orientation all zeros", change(IMU, lambda r: of_length(r, 0.0)), "orientation", "all zeros"),
    Fault("gyroscope in °/s", values(IMU, in_degrees), "gyroscope", "degrees"),
    Fault(
        "gyroscope in °/s, no orientation",
        both(
            orientation(lambda q: q * np.nan),
            values(IMU, in_degrees),
        ),
        "gyroscope",
        "degrees",
    ),
    Fault("phone's axes z, y, x", force(lambda v: v[:, ::-1]), MEAN, "z, y, x"),
    Fault("phone's z mirrored", force(lambda v: v * [1, 1, -1]), MEAN, "z axis is mirrored"),
    Fault("phone frozen from half", values(IMU, frozen), "frozen readings", "repeats one reading"),
    Fault("tracker lost: zeros", values(TRACKER, lost_as_zeros), "exact zeros", "zeros while it sees nothing"),
    Fault("tracker lost: held", values(TRACKER, lost_as_held), "held positions", "last position"),
    Fault("tracker republished", change(TRACKER, republished), "held positions", "faster than the tracker"),
    Fault("another frame in mid-log", change(TRACKER, frame_changes), "frame_id", "several frames"),
    Fault("two publishers", change(TRACKER, two_publishers), "one publisher", "two nodes"),
    Fault("tracker's clock forward", change(TRACKER, lambda r: clock_steps(r, 0.3, False)), "clock", "was set"),
    Fault("tracker's clock back", change(TRACKER, lambda r: clock_steps(r, -0.15, False)), "clock", "was set"),
    Fault("recorder's clock back", every_clock_back, "clock", "goes back"),
    Fault("whole seconds", change(TRACKER, whole_seconds), "rounded stamps", "multiple of 1 s"),
    Fault("phone in bursts", change(IMU, in_bursts), "bursts", "about 10"),
    Fault("tracker's stamps stray", change(TRACKER, jittered), "regular stamps", "irregular"),
    Fault("doubled stamps", change(IMU, doubled_stamps), "identical stamps", "stamp of another"),
    Fault("milliseconds as nanoseconds", as_if_milliseconds, "rate", "milliseconds"),
    Fault("quaternions of length 2", change(IMU, lambda r: of_length(r, 2.0)), "orientation", "no rotation"),
    Fault("no gyroscope, covariance −1", change(IMU, disclaimed), "covariances", "disregarded"),
    Fault("accelerometer all zero", force(lambda v: v * 0), "specific force", "all zero"),
    Fault("accelerometer clipped", force(lambda v: np.clip(v, -10.2, 9.3)), "clipped readings", "clipped"),
    Fault("noise understated", settings("tracker", noise_sd_mm=3.0), "tracker noise", "noise_sd_mm: "),
    Fault("noise understated by a fifth", settings("tracker", noise_sd_mm=6.4), "tracker noise", "noise_sd_mm: "),
    Fault("values that are no numbers", values(TRACKER, lost_now_and_then), "unusable samples", "send nothing while"),
    Fault("tracker in inches", values(TRACKER, lambda v: v / 0.0254), "size of the movement", "inches"),
    Fault("tracker in feet", values(TRACKER, lambda v: v / 0.3048), "size of the movement", "feet"),
    Fault("tracker in km", values(TRACKER, lambda v: v * 1e-3), "size of the movement", "kilometres"),
    Fault("two axes negated", values(TRACKER, lambda v: v * [-1, -1, 1]), FRAME, "-x -y +z"),
    Fault("accelerometer in thousandths of g", force(lambda v: v * 102), "specific force", "thousandths of g"),
    Fault("accelerometer in mm/s²", force(lambda v: v * 1e3), "specific force", "mm/s²"),
    Fault("accelerometer in counts", force(lambda v: np.round(v * 1670)), "specific force", "raw counts"),
    Fault("accelerometer in feet/s²", force(lambda v: v / 0.3048), MEAN, "feet/s²"),
    Fault("phone's x and y negated", force(lambda v: v * [-1, -1, 1]), MEAN, "x and y axes point the other way"),
    Fault("phone turned with its screen", force(lambda v: v[:, [1, 0, 2]] * [1, -1, 1]), MEAN, "turned by"),
    Fault(
        "gravity removed, sign flipped",
        both(values(IMU, without_gravity), force(lambda v: -v)),
        FRAME,
        "their sign is flipped",
    ),
    Fault("quaternion nearly w first", orientation(nearly_w_first), MEAN, "w, x, y, z"),
    Fault("orientation late", change(IMU, late_orientation), "gyroscope", "s after its gyroscope"),
    Fault("orientation frozen from half", orientation(frozen), "gyroscope", "it froze"),
    Fault("orientation lost", orientation(taken_for_another), "jumps of the orientation", "4 times in all, by up to 7"),
    Fault("gyroscope's sign", gyroscope(lambda w: -w), "gyroscope", "sign is flipped"),
    Fault("gyroscope's sign, in °/s", gyroscope(lambda w: -np.degrees(w)), "gyroscope", "degrees per second"),
    Fault("gyroscope's axes", gyroscope(lambda w: w[:, [1, 0, 2]]), "gyroscope", "in the order y, x, z"),
    Fault(
        "gyroscope's sign, no orientation",
        without_orientation(gyroscope(lambda w: -w)),
        "gyroscope",
        "sign is flipped",
    ),
    Fault("phone at 10 Hz", change(IMU, seldom), "rate", "too seldom"),
    Fault("tracker 250 ms late", change(TRACKER, lambda r: later(r, 0.25)), LAG, "latency_s: 0.3"),
    Fault("tracker 0.8 s late", change(TRACKER, lambda r: later(r, 0.8)), "one movement", "s later than those of"),
    Fault("tracker 5 s late", change(TRACKER, lambda r: later(r, 5.0)), "one movement", "5.1 s later"),
    Fault("tracker an hour off", change(TRACKER, lambda r: later(r, 3600)), "span of the streams", "time zone"),
    Fault(
        "phone's stamps two hours off",
        change(IMU, lambda r: replace(r, stamp_ns=r.stamp_ns + 7200 * 10**9)),
        "stamps and arrivals",
        "2 h, as by a time zone",
    ),
    Fault("tracker's clock gains", change(TRACKER, faster_clock), LAG, "one clock runs faster"),
    Fault("tracker finds its place anew", values(TRACKER, found_anew), "jumps", "stays there"),
    Fault("tracker strays", values(TRACKER, strays), "jumps", "strays for a reading or two"),
    Fault("log appended to itself", change(IMU, twice), "identical stamps", "sent twice"),
    Fault("reference in cm", values(REFERENCE, lambda v: v * 100), "size of the movement", "centimetres"),
    Fault("reference late", change(REFERENCE, lambda r: later(r, 0.1)), LAG, "against the reference are off by"),
    Fault("reference mirrored", values(REFERENCE, lambda v: v * [-1, 1, 1]), FRAME, "is mirrored against"),
    Fault("reference's x and y exchanged", values(REFERENCE, lambda v: v[:, [1, 0, 2]]), FRAME, "+y +x +z"),
    Fault("reference is y up", values(REFERENCE, about("x", -90)), FRAME, "axes are exchanged"),
    Fault(
        "reference of another origin",
        values(REFERENCE, lambda v: v + _ASIDE),
        "distance",
        "translation_mm",
    ),
    Fault("most frames lost", change(TRACKER, thinned), "missing samples", "the recorder does not keep up"),
)
"""Of streams and study.yaml."""

EVENT_FAULTS: tuple[Fault, ...] = (
    Fault("targets in mm", events(target_x=1e3, target_y=1e3), "targets", "millimetres"),
    Fault("targets' x and y exchanged", change(EVENTS, swapped_targets), "targets", "exchanged"),
    Fault("selections in mm", events(x=1e3, y=1e3, z=1e3), "selections", "millimetres"),
    Fault("events an hour off", change(EVENTS, lambda r: later(r, 3600)), "span of the events", "another clock"),
    Fault("events 2 s late", change(EVENTS, lambda r: later(r, 2.0)), "selections", "2.0 s earlier"),
    Fault("events in cm", placed(lambda x, y: (100 * x, 100 * y)), "selections", "centimetres"),
    Fault("events in pixels", placed(lambda x, y: (1e4 * x + 960, 540 - 1e4 * y)), "selections", "pixels"),
    Fault("targets in pixels", placed(lambda x, y: (1e4 * x, 1e4 * y)), "targets", "pixels"),
    Fault("events of another origin", placed(lambda x, y: (x + 0.3, y - 0.2)), "selections", "off by (300, -200) mm"),
    Fault("events turned", placed(lambda x, y: (0.866 * x - y / 2, x / 2 + 0.866 * y)), "selections", "turned by 30°"),
    Fault("events' x mirrored", placed(lambda x, y: (-x, y)), "targets", "x points the other way"),
    Fault("events two hours early", change(EVENTS, lambda r: later(r, -7200)), "span of the events", "-2.0 h"),
    Fault("events 0.5 s late", change(EVENTS, lambda r: later(r, 0.5)), "selections", "0.5 s earlier"),
)
"""Of events."""

"""The tables of single sessions: what was read of a log, what estimators make of it, and what figures show of it."""

from __future__ import annotations

from pipeline.tables.columns import (
    ARRIVAL,
    ESTIMATOR,
    POSITION,
    SESSION,
    STAMPED,
    STREAM,
    TARGET,
    TRIAL,
    WHO,
    Table,
    count,
    each,
    number,
    text,
)

_READING = (SESSION, STREAM, STAMPED, ARRIVAL)

SESSION_TABLES = (
    Table(
        "positions",
        "One row per message of a stream of positions: of a tracker, a reference or a display.",
        (*_READING, *POSITION),
        stages=("ingest",),
    ),
    Table(
        "readings",
        "One row per message of a stream of velocities, or of any other linear function of the hand's motion.",
        (*_READING, *each("{}", "the reading's {} in the stream's own unit; of a velocity in mm/s")),
        stages=("ingest",),
    ),
    Table(
        "imu",
        "One row per message of a phone's accelerometer and gyroscope.",
        (
            *_READING,
            *each("a{}_mm_s2", "specific force along {} of the phone; at rest it points up"),
            *each("g{}_rad_s", "angular velocity about {} of the phone"),
            *each("q{}", "{} of the quaternion from the phone's axes to the tracker's; null if unknown", "xyzw"),
        ),
        stages=("ingest",),
    ),
    Table(
        "events",
        "One row per event of the task, each once.",
        (
            SESSION,
            count("time_ns", "when the event was logged, since 1970"),
            text("type", "session_start, trial_start, selection or session_end"),
            count("trial", "number of the trial, if the event names one"),
            *TARGET,
            *each("{}_mm", "{} of what was selected; null for other events"),
        ),
        stages=("ingest",),
    ),
    Table(
        "session_orders",
        "One row per session whose log says in which order the participant met the conditions.",
        (SESSION, text("order", "what the log's metadata say: the session's place in the order, or the whole order")),
        stages=("ingest",),
    ),
    Table(
        "tracks",
        "One row per estimate: what an estimator would have shown at that instant.",
        (
            SESSION,
            ESTIMATOR,
            count("time_ns", "the instant of the estimate, since 1970"),
            *each("{}_mm", "estimated position along {}"),
            *each("sd_{}_mm", "the standard deviation the estimator states for {}"),
        ),
        stages=("fuse",),
    ),
    Table(
        "noise_residuals",
        "One row per reading in the session's longest still stretch.",
        (
            SESSION,
            STREAM,
            text("axis", "x, y or z"),
            number("residual", "reading minus slow drift, in the unit that sensor_noise names"),
        ),
        stages=("assess",),
    ),
    Table(
        "movements",
        "One row per trial: the movement from the target before, and the hand's path.",
        (
            *WHO,
            TRIAL,
            count("order", "which trial of its session it was, from 1, by its start"),
            number("duration_s", "from the trial's start to its first selection"),
            number("amplitude_mm", "from the target before to this one"),
            number("width_mm", "diameter of the target; null where neither the task nor trials.csv says it"),
            number("moved_mm", "what the hand covered along that line"),
            number("along_mm", "how far beyond the target the selection was along that line"),
            number("path_length_mm", "length of the hand's path during the trial"),
            number("shortest_mm", "length of the shortest path, along the task's own path if it has one"),
            number("overshoot_mm", "how far the hand went beyond the target"),
            count("corrections", "submovements after the first"),
        ),
        stages=("assess", "measure"),
        as_csv=True,
    ),
    Table(
        "excerpts",
        "One row per point of a line in the figures of the four seconds in which the tracker turns back furthest (moves"
        " most, if it never does).",
        (
            SESSION,
            text("axis", "the axis along which it does"),
            text("kind", "tracker (as it arrived), reference, acceleration or estimate"),
            text("name", "the stream or estimator, as study.yaml names it"),
            number("time_s", "since the session's first message"),
            number("value", "in mm; in mm/s² of an acceleration"),
            number("sd", "the estimator's stated standard deviation, in mm; null for other kinds"),
        ),
        stages=("assess",),
    ),
    Table(
        "lead_curves",
        "One row per estimator and shift in time: its cross-correlation with the tracker as it arrived.",
        (
            SESSION,
            ESTIMATOR,
            number("lead_s", "by how much the estimate is ahead of the tracker"),
            number("correlation_mm2", "unbiased cross-correlation at that lead"),
        ),
        stages=("assess",),
    ),
    Table(
        "stream_rates",
        "One row per stream and stretch of the session, of which there are 120 at most: what arrived in it.",
        (
            SESSION,
            STREAM,
            count("time_ns", "when the stretch begins, since 1970"),
            number("duration_s", "how long it is"),
            count("messages", "messages that arrived in it"),
            number("gap_max_s", "the longest silence that ended in it"),
        ),
        stages=("assess",),
    ),
)
"""In the order of the stages that write them."""

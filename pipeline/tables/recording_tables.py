"""The tables of what is known of a study's recordings: streams, sensors and estimators, gathered from its sessions."""

from __future__ import annotations

from pipeline.tables.columns import (
    CI_HIGH,
    CI_LOW,
    CONDITION,
    ESTIMATOR,
    SESSION,
    STREAM,
    STUDY,
    VARIANT,
    Table,
    count,
    each,
    number,
    text,
)

ACCURACY = Table(
    "accuracy",
    "One row per session and estimator, or variant of one: its error against the reference.",
    (
        STUDY,
        SESSION,
        ESTIMATOR,
        VARIANT,
        text("reference", "the stream that stands for the truth, or what was taken in its place"),
        number("rmse_mm", "root mean square of the Euclidean error"),
        number("sd_mm", "the standard deviation that the estimator states, over all axes"),
        number("coverage_95", "share of instants and axes with an error within 1.96 stated SDs"),
        number("lag_s", "how late the estimates are; negative: ahead of the hand"),
        number("lag_low_s", "lower end of the lag's 95 % interval (moving-block bootstrap)"),
        number("lag_high_s", "upper end of the lag's 95 % interval"),
        number("lead_xcorr_s", "how far ahead of the tracker as it arrived, by cross-correlation"),
        number("jitter_mm", "standard deviation while the hand rests; null if it never does"),
    ),
    stages=("assess", "compare"),
    commands=("replay",),
    key=("study", "session", "estimator", "variant"),
    in_results=True,
    as_csv=True,
    checked=True,
)

REPLAY_AGREEMENT = Table(
    "replay_agreement",
    "One row per session that logged its display: how far that is from the estimator when it is run again.",
    (
        SESSION,
        ESTIMATOR,
        count("n", "displayed samples that were compared"),
        number("max_mm", "the largest distance between displayed and recomputed position"),
        number("rms_mm", "the root mean square of these distances"),
    ),
    stages=("assess", "compare"),
    key=("session", "estimator"),
    in_results=True,
    as_csv=True,
    checked=True,
)

QUALITY = Table(
    "quality",
    "One row per session and stream, the events included: how it was recorded.",
    (
        SESSION,
        STREAM,
        count("messages_read", "usable messages"),
        count("messages_lost", "messages the log lost; null if that cannot be known"),
        number("rate_hz", "messages per second of the stream's own clock"),
        number("gap_max_s", "longest time between two stamps"),
        count("duplicates", "stamps that stand more than once"),
        count("out_of_order", "stamps earlier than one that arrived before"),
        number("jitter_ms", "standard deviation of the time between arrivals, gaps left out"),
        number("latency_s", "median of arrival minus stamp"),
        text("note", "what else was noticed"),
    ),
    stages=("ingest", "compare"),
    key=("session", "stream"),
    in_results=True,
    as_csv=True,
)

RECORDERS = Table(
    "recorders",
    "One row per session whose log says that Steadyhand recorded it live.",
    (
        SESSION,
        text("recorder", "what recorded it, with its version"),
        text("settings", "digest of what study.yaml said of the recording; where it differs, other settings"),
        text("attempt", "which attempt at the task it was"),
        text("started_although", "the reason to begin over a red light, or without a check; null where none was given"),
        text("overruled", "what the red lights said then, and which checks were not done; null where none was"),
    ),
    stages=("ingest", "compare"),
    key=("session",),
    in_results=True,
    as_csv=True,
)

CHECKS = Table(
    "checks",
    "One row per check of what a log or a table claims: against its own readings and against study.yaml.",
    (
        SESSION._replace(about="the session; null for a check of a table"),
        text("check", "what was checked, and of which stream: as in rate: tracker"),
        text("status", "green, amber or red"),
        text("found", "what the readings say"),
        text("expected", "what they should say"),
        text("message", "the likely cause and the remedy; null where there is nothing to say"),
    ),
    stages=("ingest", "assess", "measure", "compare"),
    key=("session", "check"),
    in_results=True,
    as_csv=True,
)

SENSOR_NOISE = Table(
    "sensor_noise",
    "One row per session and sensor: its noise in the session's longest still stretch.",
    (
        SESSION,
        STREAM,
        text("unit", "unit of sd and stated_sd"),
        number("begin_s", "when the stretch begins, since the session's first message"),
        number("end_s", "when it ends"),
        count("n", "readings in it"),
        number("sd", "standard deviation of the readings about their slow drift, in that unit"),
        number("stated_sd", "the noise that the estimators are told, in the same unit"),
    ),
    stages=("assess", "compare"),
    key=("session", "stream"),
    in_results=True,
    as_csv=True,
)

SENSORS_FOUND = Table(
    "sensors_found",
    "One row per session, estimator that finds its sensors, and figure: what a sensor is like, beside what is stated.",
    (
        SESSION,
        ESTIMATOR,
        STREAM,
        text("quantity", "tracker_noise, tracker_late, mounting_x …, heading, scale, bias_x …, lever_arm_x …"),
        text("unit", "unit of the figures"),
        number("value", "as found by the end of the session"),
        CI_LOW._replace(about="lower end of its 95 % interval"),
        CI_HIGH._replace(about="upper end of its 95 % interval"),
        number("stated", "the noise that study.yaml states; 0 of what departs from it; null of a lever arm"),
    ),
    stages=("assess", "compare"),
    key=("session", "estimator", "quantity"),
    in_results=True,
    as_csv=True,
)

PHONES = Table(
    "phones",
    "One row per session and accelerometer: where its orientation came from and how it was mounted.",
    (
        SESSION,
        STREAM,
        count("in_log", "accelerations whose orientation stands in the log"),
        count("carried", "those with the last known orientation, carried on by the gyroscope"),
        count("found", "those whose orientation was found from gyroscope, accelerometer and tracker"),
        count("left_out", "those of unknown orientation, which were not used"),
        number("calibrated_until_s", "until when the mounting was learned; null if it was not"),
        *each("mounting_{}_deg", "rotation of the phone's axes about {}"),
        *each("mounting_sd_{}_deg", "standard deviation of the rotation about {}"),
        *each("lever_arm_{}_mm", "{} of the way from the accelerometer to the tracked point"),
        *each("lever_arm_sd_{}_mm", "standard deviation of that {}"),
    ),
    stages=("assess", "compare"),
    key=("session", "stream"),
    in_results=True,
    as_csv=True,
)

SHOWN_AT_SELECTION = Table(
    "shown_at_selection",
    "One row per condition and estimator: how far from the target it would have shown the selections.",
    (
        CONDITION,
        ESTIMATOR._replace(about="the estimator; recorded: where participants selected"),
        count("n", "participants"),
        number("rmse_mm", "root of the mean over participants of their mean squared errors"),
    ),
    stages=("compare",),
    key=("condition", "estimator"),
    in_results=True,
    as_csv=True,
)

ACCURACY_MEANS = Table(
    "accuracy_means",
    "One row per estimator: means of accuracy over sessions.",
    (
        ESTIMATOR,
        count("n", "sessions"),
        number("rmse_mm", "mean root mean square error"),
        number("sd_mm", "mean stated standard deviation"),
        number("coverage_95", "mean share of errors within 1.96 stated SDs"),
        number("lag_s", "mean lag; positive: late"),
        number("lead_xcorr_s", "mean lead over the tracker"),
        number("jitter_mm", "mean jitter of the sessions that have one"),
    ),
    stages=("compare",),
    key=("estimator",),
    in_results=True,
    as_csv=True,
)

CALIBRATION = Table(
    "calibration",
    "One row per session, estimator and multiple of the stated SD: how many errors are within it.",
    (
        SESSION,
        ESTIMATOR,
        count("percent_of_sd", "the multiple, in hundredths of the stated standard deviation"),
        count("within", "instants and axes with an error within it"),
        count("n", "all instants and axes"),
    ),
    stages=("assess", "compare"),
    as_csv=True,
)

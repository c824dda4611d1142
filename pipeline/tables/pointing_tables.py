"""The tables of how people point: practice from trial to trial, and Fitts' law."""

from __future__ import annotations

from pipeline.tables.columns import (
    CI_HIGH,
    CI_LOW,
    CONDITION,
    DF2,
    MEASURE,
    STATISTIC,
    STATISTIC_NAME,
    P,
    Table,
    count,
    number,
    text,
)

_DIFFICULTY = text("difficulty", "nominal, from the targets as shown; or effective, from where people selected")

LEARNING = Table(
    "learning",
    "One row per condition, and per pair: how a trial's time changes with its number, by the power law of practice.",
    (
        MEASURE,
        text("trials", "all trials, or the last half of each participant's in the condition"),
        text("contrast", "the condition; of two their difference, as first - second"),
        count("n", "participants with three such trials or more"),
        count("left_out", "other participants with trials: fewer than three, or several sessions of the condition"),
        number("slope", "mean over participants of the slope of log time on log trial number; below 0 is faster"),
        CI_LOW._replace(about="lower end of the slope's 95 % interval"),
        CI_HIGH._replace(about="upper end of the slope's 95 % interval"),
        number("ratio_when_trials_double", "what doubling the trials makes of the time: 2 to the power of the slope"),
        number("first_trial_s", "where the curve begins: time of the first trial; null for a pair"),
        STATISTIC_NAME,
        STATISTIC,
        DF2,
        P,
        number("p_adjusted", "p adjusted after Holm, over the conditions or over the pairs"),
        text("effect_size_name", "what the effect size is"),
        number("effect_size", "mean slope, or difference of slopes, over its SD between participants"),
        text("method", "how exactly the test was done"),
        text("status", "ok, or why there is no test"),
        text("remark", "why the slope may not be one of practice; null if nothing speaks against it"),
    ),
    stages=("compare",),
    key=("measure", "trials", "contrast"),
    in_results=True,
    as_csv=True,
)

FITTS = Table(
    "fitts",
    "One row per condition and kind of difficulty: movement time as a line over the index of difficulty (Fitts' law).",
    (
        CONDITION,
        _DIFFICULTY,
        count("n", "participants with five movements or more of one distance and target width"),
        count("blocks", "points that the line goes through, each of one distance and width"),
        number("intercept_s", "movement time at 0 bits"),
        number("intercept_ci_low_s", "lower end of its 95 % interval"),
        number("intercept_ci_high_s", "upper end of its 95 % interval"),
        number("slope_s_bit", "by how many seconds a movement takes longer with each bit"),
        number("slope_ci_low_s_bit", "lower end of its 95 % interval"),
        number("slope_ci_high_s_bit", "upper end of its 95 % interval"),
        number("r_squared", "share of the variance between points that the line explains"),
        number(
            "throughput_bits_s", "difficulty over movement time, mean over participants of their means over the points"
        ),
        text("status", "ok, or why there is no line"),
        text("remark", "what speaks against reading the line as Fitts' law; null if nothing does"),
    ),
    stages=("compare",),
    key=("condition", "difficulty"),
    in_results=True,
    as_csv=True,
)

FITTS_POINTS = Table(
    "fitts_points",
    "One row per condition, kind of difficulty, and distance and width of targets: a point of the lines of fitts.",
    (
        CONDITION,
        _DIFFICULTY,
        text("block", "distance A from the target before and width W of the target, as shown"),
        count("n", "participants with five such movements or more"),
        count("movements", "their movements"),
        number("amplitude_mm", "mean distance: between targets, or effective, as covered"),
        number("width_mm", "mean width: of the target, or effective, 4.133 SD of where people selected"),
        number("difficulty_bits", "mean over participants of log₂(A/W + 1)"),
        number("movement_time_s", "mean over participants of the trial's duration"),
    ),
    stages=("compare",),
    key=("condition", "difficulty", "block"),
    in_results=True,
    as_csv=True,
)

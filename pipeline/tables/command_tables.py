"""The tables of commands that look beyond one study as it is: replay and explore."""

from __future__ import annotations

from pipeline.tables.columns import (
    CI_HIGH,
    CI_LOW,
    ERROR,
    ESTIMATOR,
    PARTICIPANT,
    SQUARED_ERROR,
    STUDY,
    TRIAL,
    VARIANT,
    WHO,
    Column,
    Table,
    count,
    number,
    text,
)

_TRACKER = (
    number("latency_s", "the simulated tracker's latency"),
    number("noise_sd_mm", "standard deviation of its noise, per axis"),
    number("rate_hz", "its frames per second"),
)


def _interval(stem: str, unit: str, about: str) -> tuple[Column, ...]:
    """A mean and the two ends of its 95 % interval."""
    return (
        number(f"{stem}{unit}", about),
        number(f"{stem}_low{unit}", "lower end of its 95 % interval"),
        number(f"{stem}_high{unit}", "upper end of its 95 % interval"),
    )


REPLAY_TABLES = (
    Table(
        "replay_trials",
        "One row per trial and variant: how far from the target the variant would have shown the selection.",
        (STUDY, *WHO, TRIAL, ESTIMATOR, VARIANT, ERROR, SQUARED_ERROR),
        commands=("replay",),
    ),
    Table(
        "replay_means",
        "One row per study and variant: means over sessions, and the variant's rank.",
        (
            STUDY._replace(about="name of the study's folder; null for all studies together"),
            count("rank", "place by mean RMSE, from 1; null without a reference"),
            ESTIMATOR,
            VARIANT,
            count("n", "sessions with accuracy"),
            *_interval("rmse", "_mm", "mean root mean square error"),
            *_interval("sd", "_mm", "mean stated standard deviation"),
            *_interval("coverage", "_95", "mean share of errors within 1.96 stated SDs"),
            *_interval("lag", "_s", "mean lag; positive: late"),
            *_interval("jitter", "_mm", "mean standard deviation while the hand rests"),
            *_interval("selection_rmse", "_mm", "root of the mean over sessions of squared distance to the target"),
            count("selection_n", "sessions with selections"),
        ),
        commands=("replay",),
        key=("study", "estimator", "variant"),
        in_results=True,
    ),
    Table(
        "replay_exclusions",
        "One row per session or file that is not in the replay, or only in part.",
        (
            STUDY,
            *WHO,
            VARIANT._replace(about="the variant or estimator that failed; null if it concerns all"),
            text("what", "what happened"),
            text("reason", "why"),
        ),
        commands=("replay",),
        key=("study", "participant", "condition", "session", "variant", "what"),
        in_results=True,
    ),
)

EXPLORE_TABLES = (
    Table(
        "explore",
        "One row per simulated tracker and estimator: means over the people who selected something.",
        (
            *_TRACKER,
            ESTIMATOR,
            count("people", "simulated people"),
            count("n", "those of them who selected something"),
            *_interval("completion_time", "_s", "mean completion time"),
            *_interval("selection_rmse", "_mm", "root of the mean over people of their mean squared errors"),
            count("selections", "selections of all people"),
            count("misses", "selections outside the target"),
            count("not_selected", "targets that nobody selected before the session was ended"),
        ),
        commands=("explore",),
        in_results=True,
        as_csv=True,
    ),
    Table(
        "explore_differences",
        "One row per tracker, measure and pair of estimators, compared person by person.",
        (
            *_TRACKER,
            text("measure", "selection_mse_mm2 or completion_time_s"),
            text("first", "the first estimator"),
            text("second", "the second estimator"),
            count("n", "people with both"),
            number("mean_difference", "mean of first minus second, in the measure's unit"),
            CI_LOW,
            CI_HIGH,
            number("reduction", "1 minus second mean over first mean"),
            number("effect_size", "Cohen's d_z, without a unit"),
            count("participants_needed", "participants that show the difference with a power of 80 %; null above 1000"),
            count("participants_low", "the same at the end of d_z's 95 % interval that is further from zero"),
            count("participants_high", "the same at the nearer end; null if the interval includes zero"),
            text("status", "ok, or why the row could not be computed"),
        ),
        commands=("explore",),
        in_results=True,
        as_csv=True,
    ),
    Table(
        "explore_people",
        "One row per simulated session.",
        (
            *_TRACKER,
            ESTIMATOR,
            count("repeat", "number of the repeated small study, from 1"),
            PARTICIPANT,
            number("completion_time_s", "from the session's start to its last selection"),
            number("selection_mse_mm2", "mean squared distance from the target"),
            count("selections", "targets that were selected"),
            count("misses", "selections outside the target"),
            count("not_selected", "targets that were not selected before the session was ended"),
        ),
        commands=("explore",),
        in_results=True,
        as_csv=True,
    ),
)

"""The columns of every table, with the unit in each name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import pyarrow as pa

if TYPE_CHECKING:
    pass


S_PER_NS = 1e-9
"""Times in tables are whole nanoseconds; seconds are for people and for fusion_core."""
NS_PER_S = 1e9

_TEXT, _FLOAT, _TIME, _COUNT = pa.string(), pa.float64(), pa.int64(), pa.int64()


_TRACKER = [("latency_s", _FLOAT), ("noise_sd_mm", _FLOAT), ("rate_hz", _FLOAT)]


_POSITION = [(f"{axis}_mm", _FLOAT) for axis in "xyz"]


_COMPARISON = [
    ("measure", _TEXT),
    ("test", _TEXT),
    ("effect", _TEXT),
    ("contrast", _TEXT),
    ("n", _COUNT),
    ("statistic_name", _TEXT),
    ("statistic", _FLOAT),
    ("df1", _FLOAT),
    ("df2", _FLOAT),
    ("p", _FLOAT),
    ("p_adjusted", _FLOAT),
    ("adjust", _TEXT),
    ("method", _TEXT),
    ("effect_size_name", _TEXT),
    ("effect_size", _FLOAT),
    ("ci_low", _FLOAT),
    ("ci_high", _FLOAT),
    ("mean_difference", _FLOAT),
    ("reduction", _FLOAT),
    ("status", _TEXT),
    ("details", _TEXT),  # JSON
]


def _schema(*columns: tuple[str, pa.DataType]) -> pa.Schema:
    return pa.schema(list(columns))


TABLES: Mapping[str, pa.Schema] = {
    "positions": _schema(("session", _TEXT), ("stream", _TEXT), ("time_ns", _TIME), ("arrival_ns", _TIME), *_POSITION),
    "readings": _schema(
        ("session", _TEXT),
        ("stream", _TEXT),
        ("time_ns", _TIME),
        ("arrival_ns", _TIME),
        *[(axis, _FLOAT) for axis in "xyz"],
    ),
    "imu": _schema(
        ("session", _TEXT),
        ("stream", _TEXT),
        ("time_ns", _TIME),
        ("arrival_ns", _TIME),
        *[(f"a{axis}_mm_s2", _FLOAT) for axis in "xyz"],
        *[(f"g{axis}_rad_s", _FLOAT) for axis in "xyz"],
        *[(f"q{axis}", _FLOAT) for axis in "xyzw"],
    ),
    "events": _schema(
        ("session", _TEXT),
        ("time_ns", _TIME),
        ("type", _TEXT),
        ("trial", _COUNT),
        *[(f"target_{axis}_mm", _FLOAT) for axis in "xyz"],
        *_POSITION,
    ),
    "quality": _schema(
        ("session", _TEXT),
        ("stream", _TEXT),
        ("messages_read", _COUNT),
        ("messages_lost", _COUNT),
        ("rate_hz", _FLOAT),
        ("gap_max_s", _FLOAT),
        ("duplicates", _COUNT),
        ("out_of_order", _COUNT),
        ("jitter_ms", _FLOAT),
        ("latency_s", _FLOAT),
        ("note", _TEXT),
    ),
    "phones": _schema(
        ("session", _TEXT),
        ("stream", _TEXT),
        ("in_log", _COUNT),
        ("carried", _COUNT),
        ("found", _COUNT),
        ("left_out", _COUNT),
        ("calibrated_until_s", _FLOAT),
        *[(f"mounting_{axis}_deg", _FLOAT) for axis in "xyz"],
        *[(f"mounting_sd_{axis}_deg", _FLOAT) for axis in "xyz"],
        *[(f"lever_arm_{axis}_mm", _FLOAT) for axis in "xyz"],
        *[(f"lever_arm_sd_{axis}_mm", _FLOAT) for axis in "xyz"],
    ),
    "session_orders": _schema(("session", _TEXT), ("order", _TEXT)),  # as the log's facts say it
    "tracks": _schema(
        ("session", _TEXT),
        ("estimator", _TEXT),
        ("time_ns", _TIME),
        *_POSITION,
        *[(f"sd_{axis}_mm", _FLOAT) for axis in "xyz"],
    ),
    "trials": _schema(
        ("participant", _TEXT),
        ("condition", _TEXT),
        ("session", _TEXT),
        ("trial", _COUNT),
        ("estimator", _TEXT),
        ("position_error_mm", _FLOAT),
        ("squared_error_mm2", _FLOAT),
        ("duration_s", _FLOAT),
    ),
    "movements": _schema(
        ("session", _TEXT),
        ("trial", _COUNT),
        ("duration_s", _FLOAT),
        ("amplitude_mm", _FLOAT),
        ("moved_mm", _FLOAT),
        ("along_mm", _FLOAT),
        ("across_mm", _FLOAT),
        ("path_length_mm", _FLOAT),
        ("shortest_mm", _FLOAT),
        ("overshoot_mm", _FLOAT),
        ("corrections", _COUNT),
    ),
    "measures": _schema(
        ("participant", _TEXT),
        ("condition", _TEXT),
        ("factors", _TEXT),
        ("measure", _TEXT),
        ("value", _FLOAT),
    ),
    "observations": _schema(
        ("participant", _TEXT),
        ("condition", _TEXT),
        ("session", _TEXT),
        ("factors", _TEXT),
        ("period", _COUNT),
        ("sequence", _TEXT),
        ("measure", _TEXT),
        ("n", _COUNT),
        ("value", _FLOAT),
    ),
    "orders": _schema(
        ("participant", _TEXT), ("condition", _TEXT), ("session", _TEXT), ("period", _COUNT), ("source", _TEXT)
    ),
    "sequences": _schema(("participant", _TEXT), ("sequence", _TEXT)),
    "design_check": _schema(
        ("what", _TEXT),
        ("measure", _TEXT),
        ("condition", _TEXT),
        ("found", _TEXT),
        ("expected", _TEXT),
        ("statistic_name", _TEXT),
        ("statistic", _FLOAT),
        ("df1", _FLOAT),
        ("df2", _FLOAT),
        ("p", _FLOAT),
        ("remark", _TEXT),
    ),
    "simulated_reductions": _schema(
        ("measure", _TEXT),
        ("contrast", _TEXT),
        ("n", _COUNT),  # repeated studies
        ("reduction", _FLOAT),
        ("ci_low", _FLOAT),
        ("ci_high", _FLOAT),
        ("published_reduction", _FLOAT),
        ("source", _TEXT),
    ),
    "descriptives": _schema(
        ("measure", _TEXT),
        ("condition", _TEXT),
        ("n", _COUNT),
        ("mean", _FLOAT),
        ("sd", _FLOAT),
        ("median", _FLOAT),
        ("ci_low", _FLOAT),
        ("ci_high", _FLOAT),
    ),
    "comparisons": _schema(*_COMPARISON),
    "comparisons_all_data": _schema(*_COMPARISON),  # without the exclusions of study.yaml; empty where there are none
    "accuracy": _schema(
        ("study", _TEXT),
        ("session", _TEXT),
        ("estimator", _TEXT),
        ("variant", _TEXT),
        ("reference", _TEXT),
        ("rmse_mm", _FLOAT),
        ("sd_mm", _FLOAT),
        ("coverage_95", _FLOAT),
        ("lag_s", _FLOAT),
        ("lag_low_s", _FLOAT),
        ("lag_high_s", _FLOAT),
        ("lead_xcorr_s", _FLOAT),
        ("jitter_mm", _FLOAT),
    ),
    "accuracy_means": _schema(
        ("estimator", _TEXT),
        ("n", _COUNT),
        ("rmse_mm", _FLOAT),
        ("sd_mm", _FLOAT),
        ("coverage_95", _FLOAT),
        ("lag_s", _FLOAT),
        ("lead_xcorr_s", _FLOAT),
        ("jitter_mm", _FLOAT),
    ),
    "replay_agreement": _schema(
        ("session", _TEXT), ("estimator", _TEXT), ("n", _COUNT), ("max_mm", _FLOAT), ("rms_mm", _FLOAT)
    ),
    "sensor_noise": _schema(
        ("session", _TEXT),
        ("stream", _TEXT),
        ("unit", _TEXT),
        ("begin_s", _FLOAT),
        ("end_s", _FLOAT),
        ("n", _COUNT),
        ("sd", _FLOAT),
        ("stated_sd", _FLOAT),
    ),
    "noise_residuals": _schema(("session", _TEXT), ("stream", _TEXT), ("axis", _TEXT), ("residual", _FLOAT)),
    "excerpts": _schema(  # value and sd in mm, of kind acceleration in mm/s²
        ("session", _TEXT),
        ("axis", _TEXT),
        ("kind", _TEXT),  # tracker (by arrival), reference, acceleration, estimate
        ("name", _TEXT),  # of the stream or the estimator
        ("time_s", _FLOAT),  # since the session's first message
        ("value", _FLOAT),
        ("sd", _FLOAT),
    ),
    "lead_curves": _schema(("session", _TEXT), ("estimator", _TEXT), ("lead_s", _FLOAT), ("correlation_mm2", _FLOAT)),
    "calibration": _schema(  # how many (instant, axis) of n have an error within so many hundredths of the stated SD
        ("session", _TEXT), ("estimator", _TEXT), ("percent_of_sd", _COUNT), ("within", _COUNT), ("n", _COUNT)
    ),
    "stream_rates": _schema(  # what arrived from time_ns on; gap_max_s: the longest silence to end then
        ("session", _TEXT),
        ("stream", _TEXT),
        ("time_ns", _TIME),
        ("duration_s", _FLOAT),
        ("messages", _COUNT),
        ("gap_max_s", _FLOAT),
    ),
    "selections": _schema(
        ("participant", _TEXT),
        ("condition", _TEXT),
        ("session", _TEXT),
        ("trial", _COUNT),
        *[(f"target_{axis}_mm", _FLOAT) for axis in "xyz"],
        *_POSITION,
    ),
    "shown_at_selection": _schema(("condition", _TEXT), ("estimator", _TEXT), ("n", _COUNT), ("rmse_mm", _FLOAT)),
    "replay_trials": _schema(
        ("study", _TEXT),
        ("participant", _TEXT),
        ("condition", _TEXT),
        ("session", _TEXT),
        ("trial", _COUNT),
        ("estimator", _TEXT),
        ("variant", _TEXT),
        ("position_error_mm", _FLOAT),
        ("squared_error_mm2", _FLOAT),
    ),
    "replay_means": _schema(  # study is null for all studies together
        ("study", _TEXT),
        ("rank", _COUNT),
        ("estimator", _TEXT),
        ("variant", _TEXT),
        ("n", _COUNT),
        *[
            (f"{figure}{end}{unit}", _FLOAT)
            for figure, unit in (
                ("rmse", "_mm"),
                ("sd", "_mm"),
                ("coverage", "_95"),
                ("lag", "_s"),
                ("jitter", "_mm"),
                ("selection_rmse", "_mm"),
            )
            for end in ("", "_low", "_high")
        ],
        ("selection_n", _COUNT),
    ),
    "replay_exclusions": _schema(
        ("study", _TEXT),
        ("participant", _TEXT),
        ("condition", _TEXT),
        ("session", _TEXT),
        ("variant", _TEXT),
        ("what", _TEXT),
        ("reason", _TEXT),
    ),
    "exclusions": _schema(
        ("participant", _TEXT),
        ("condition", _TEXT),
        ("session", _TEXT),
        ("measure", _TEXT),
        ("what", _TEXT),
        ("reason", _TEXT),
    ),
    "explore_people": _schema(  # a row a simulated session; misses are selections outside the target
        *_TRACKER,
        ("estimator", _TEXT),
        ("repeat", _COUNT),
        ("participant", _TEXT),
        ("completion_time_s", _FLOAT),
        ("selection_mse_mm2", _FLOAT),
        ("selections", _COUNT),
        ("misses", _COUNT),
        ("not_selected", _COUNT),
    ),
    "explore": _schema(  # n of the people have selected something
        *_TRACKER,
        ("estimator", _TEXT),
        ("people", _COUNT),
        ("n", _COUNT),
        *[(f"completion_time{end}_s", _FLOAT) for end in ("", "_low", "_high")],
        *[(f"selection_rmse{end}_mm", _FLOAT) for end in ("", "_low", "_high")],
        ("selections", _COUNT),
        ("misses", _COUNT),
        ("not_selected", _COUNT),
    ),
    "explore_differences": _schema(  # effect_size is d_z; participants are null beyond the most that are looked at
        *_TRACKER,
        ("measure", _TEXT),
        ("first", _TEXT),
        ("second", _TEXT),
        ("n", _COUNT),
        ("mean_difference", _FLOAT),
        ("ci_low", _FLOAT),
        ("ci_high", _FLOAT),
        ("reduction", _FLOAT),
        ("effect_size", _FLOAT),
        ("participants_needed", _COUNT),
        ("participants_low", _COUNT),
        ("participants_high", _COUNT),
        ("status", _TEXT),
    ),
    "reliability": _schema(
        ("measure", _TEXT),
        ("rule", _TEXT),
        ("items", _COUNT),
        ("n", _COUNT),
        ("alpha", _FLOAT),
        ("ci_low", _FLOAT),
        ("ci_high", _FLOAT),
        ("assumes", _TEXT),
        ("status", _TEXT),
    ),
    "printed": _schema(
        ("what", _TEXT),
        ("check", _TEXT),
        ("source", _TEXT),
        ("printed", _TEXT),
        ("computed", _TEXT),
        ("computed_value", _FLOAT),
        ("verdict", _TEXT),
        ("explanation", _TEXT),
    ),
}
"""Every table by name. Columns never vary with data or options; what does not apply is null."""

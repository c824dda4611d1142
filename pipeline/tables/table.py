"""The tables every stage speaks: their columns, with the unit in each name, and the one crossing to fusion_core."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

if TYPE_CHECKING:
    from fusion_core.samples import Samples

pa.set_memory_pool(pa.system_memory_pool())  # small tables by the thousand: the usual pool keeps what they leave

_TEXT, _FLOAT, _TIME, _COUNT = pa.string(), pa.float64(), pa.int64(), pa.int64()
_NULLABLE = {_TEXT: pd.StringDtype(), _COUNT: pd.Int64Dtype()}
_PANDAS = {**_NULLABLE, _FLOAT: np.dtype("float64")}  # as a frame holds them
_SMALL = 512  # rows
_PARTS = 256  # tables read before they are made one: each takes more than the few rows that are in it
_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # a spreadsheet would take a cell that begins so for a command
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

Row = Mapping[str, Any]


def frame(name: str, rows: Iterable[Row]) -> pd.DataFrame:
    """Rows as the named table; a key it does not know is a programming error (KeyError)."""
    listed = list(rows)
    columns = _known_columns(name, listed)
    return as_table(name, pd.DataFrame([[row.get(column) for column in columns] for row in listed], columns=columns))


def of_rows(name: str, rows: Iterable[Row]) -> pa.Table:
    """As `frame`, for Arrow, which takes a tenth of the time where rows are few; values must be of the columns' types.

    NaN is null.
    """
    listed = list(rows)
    columns = _known_columns(name, listed)
    kinds = TABLES[name].types
    arrays = [
        pa.array([row.get(column) for row in listed], kind, from_pandas=True)
        for column, kind in zip(columns, kinds, strict=True)
    ]
    return pa.Table.from_arrays(arrays, schema=TABLES[name])


def _known_columns(name: str, rows: Sequence[Row]) -> list[str]:
    """The table's columns; KeyError for a row that has another."""
    columns: list[str] = TABLES[name].names
    for row in rows:
        unknown = row.keys() - set(columns)
        if unknown:
            raise KeyError(f"table {name} has no column {', '.join(sorted(unknown))}")
    return columns


def of_columns(name: str, length: int, columns: Mapping[str, Any]) -> pa.Table:
    """The named table of so many rows by arrays (length,), and single values that hold for every row.

    A column that is not there, and NaN, is null.
    """
    arrays = []
    for column in TABLES[name]:
        value = columns.get(column.name)
        if isinstance(value, np.ndarray):
            arrays.append(pa.array(value, column.type, from_pandas=True))
        else:
            arrays.append(pa.repeat(pa.scalar(value, column.type), length))
    return pa.Table.from_arrays(arrays, schema=TABLES[name])


def as_table(name: str, data: pd.DataFrame) -> pd.DataFrame:
    """A frame with exactly the table's columns, in its order and types."""
    if data.columns.tolist() == TABLES[name].names and data.dtypes.tolist() == [_PANDAS[c.type] for c in TABLES[name]]:
        return data.copy(deep=False)
    converted = {}
    for column in TABLES[name]:
        values = data[column.name] if column.name in data else pd.Series([None] * len(data), index=data.index)
        converted[column.name] = _typed(values, column.type)
    return pd.DataFrame(converted, index=data.index)


def _typed(values: pd.Series, kind: pa.DataType) -> pd.Series:
    if values.dtype == _PANDAS[kind]:
        return values
    if kind == _TEXT:
        return values.astype("string")
    if kind == _FLOAT:
        return pd.to_numeric(values).astype("float64")
    return pd.to_numeric(values).astype("Int64")


def write(name: str, data: pd.DataFrame | pa.Table, folder: Path) -> None:
    """The table as Parquet, `<name>.parquet`; a small one plain, since unpacking it would take most of its reading."""
    if isinstance(data, pd.DataFrame):
        data = pa.Table.from_pandas(as_table(name, data), schema=TABLES[name], preserve_index=False)
    floats = [column.name for column in TABLES[name] if column.type == _FLOAT]
    times = [column.name for column in TABLES[name] if column.name.endswith("_ns")]
    encodings = dict.fromkeys(floats, "BYTE_STREAM_SPLIT") | dict.fromkeys(times, "DELTA_BINARY_PACKED")
    plain = [column.name for column in TABLES[name] if column.name not in encodings]
    small = len(data) <= _SMALL
    with pa.OSFile(str(folder / f"{name}.parquet"), "wb") as file:
        pq.write_table(
            data.replace_schema_metadata(None),
            file,
            compression="none" if small else "zstd",
            use_dictionary=False if small else plain,
            column_encoding=None if small else encodings,
            store_schema=False,
        )


def write_csv(name: str, data: pd.DataFrame, folder: Path) -> None:
    """The table as `<name>.csv`; text that a spreadsheet would run as a formula gets an apostrophe in front."""
    table = as_table(name, data)
    for column in table.columns[[str(kind) == "string" for kind in table.dtypes]]:
        risky = table[column].str.startswith(_FORMULA).fillna(False).astype(bool)
        table[column] = table[column].where(~risky, "'" + table[column])
    table.to_csv(folder / f"{name}.csv", index=False)


def read(name: str, folders: Path | Sequence[Path]) -> pd.DataFrame:
    """The table out of one or many folders; those without it count as empty."""
    # Straight to the types of `as_table`; by way of objects it takes three times as long.
    found: pd.DataFrame = read_arrow(name, folders).to_pandas(types_mapper=_NULLABLE.get)
    return found


def read_arrow(name: str, folders: Path | Sequence[Path]) -> pa.Table:
    """As `read`, as it is in the files."""
    whole, parts = [], []
    for folder in [folders] if isinstance(folders, Path) else folders:
        path = folder / f"{name}.parquet"
        with suppress(FileNotFoundError):
            content = pa.BufferReader(path.read_bytes())  # a file object of its own takes longer than a small table
            parts.append(pq.ParquetFile(content).read(use_threads=False))
        if len(parts) == _PARTS:
            whole.append(pa.concat_tables(parts).combine_chunks())
            parts = []
    return pa.concat_tables([*whole, *parts]) if whole or parts else TABLES[name].empty_table()


Columns = Mapping[str, np.ndarray[Any, Any]]
"""Columns of a table by name, (n,) each."""


def of_stream(table: pa.Table, stream: str) -> Columns:
    """The columns of one stream's rows as arrays (n,): times in ns, and figures, NaN where they are null."""
    rows = table.filter(pc.equal(table["stream"], stream))
    names = [column.name for column in table.schema if column.type != _TEXT]
    return {name: rows[name].to_numpy() for name in names}


def records(name: str, data: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Rows as plain objects for JSON: null for what does not apply, `details` and `factors` as they are stored."""
    for row in as_table(name, data).itertuples(index=False):
        yield {key: _plain(value) for key, value in zip(TABLES[name].names, row, strict=True)}


def _plain(value: Any) -> Any:
    if value is None or value is pd.NA or (isinstance(value, float) and not np.isfinite(value)):
        return None
    if isinstance(value, np.integer):
        return int(value)
    return float(value) if isinstance(value, float) else value


def participant_means(measures: pd.DataFrame, measure: str, conditions: Sequence[str]) -> pd.DataFrame:
    """A row a participant, a column a condition in the given order: means over everything else, NaN if missing."""
    rows = measures[measures["measure"] == measure]
    wide = rows.pivot_table(index="participant", columns="condition", values="value", aggfunc="mean", sort=True)
    return wide.reindex(columns=list(conditions)).astype("float64")


NANOSECONDS = 1e-9


def samples(
    time_ns: np.ndarray[Any, Any],
    arrival_ns: np.ndarray[Any, Any],
    value: np.ndarray[Any, Any],
    origin_ns: int,
) -> Samples:
    """The crossing into fusion_core: readings by arrival, in seconds since `origin_ns`, each reading once.

    A reading whose stamp and values another one already had is a copy of it and left out (`quality` counts them).
    """
    order = np.lexsort((time_ns, arrival_ns))
    time_ns, arrival_ns, value = time_ns[order], arrival_ns[order], value[order]
    kept = np.flatnonzero(~pd.DataFrame(value).assign(stamp=time_ns).duplicated())
    from fusion_core.samples import Samples  # and with it the compiler, which most commands never need

    return Samples(
        (time_ns[kept] - origin_ns) * NANOSECONDS,
        (arrival_ns[kept] - origin_ns) * NANOSECONDS,
        np.ascontiguousarray(value[kept], dtype=np.float64),
    )

"""Quality facts of a stream: how often, how regularly, how late, what is missing."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.sessions.logs.log import IntArray, Readings
from pipeline.sessions.sampling import sampling
from pipeline.statistics.arrays import FloatArray
from pipeline.tables.columns import S_PER_NS
from pipeline.words.phrases import counted

_STEP_BACK_MIN = 10  # messages: a clock that went back stays back; a late message comes alone
_FORWARDS = 0.8  # of the steps in a run; in shuffled messages half of them are


def quality_row(session: str, stream: str, readings: Readings, notes: list[str]) -> dict[str, Any]:
    """One row of the table `quality`. Stamps are judged in order of arrival."""
    stamp, arrival = readings.stamp_ns, readings.arrival_ns
    in_order = not (arrival[1:] < arrival[:-1]).any()
    if not in_order:
        order = np.argsort(arrival, kind="stable")
        stamp, arrival = stamp[order], arrival[order]
    remarks = [*readings.notes, *notes]
    apart_ns = np.diff(stamp if (stamp[1:] >= stamp[:-1]).all() else np.sort(stamp))
    row: dict[str, Any] = {
        "session": session,
        "stream": stream,
        "messages_read": readings.read,
        "messages_lost": readings.lost,
        "duplicates": int(np.sum(apart_ns == 0)),
        "out_of_order": _behind(stamp),
    }
    if readings.lost is None:
        remarks.append("how many messages the log lost cannot be known")
    if not in_order:
        remarks.append("messages are not in order of arrival in the file; sorted")
    steps: FloatArray = apart_ns[apart_ns > 0].astype(np.float64)
    steps *= S_PER_NS
    if len(steps):
        usual = float(np.median(steps))
        regular = np.diff(arrival) * S_PER_NS
        regular = regular[regular <= 1.5 * usual]
        row["rate_hz"] = len(steps) / float(steps.sum())
        row["gap_max_s"] = float(steps.max())
        row["jitter_ms"] = float(np.std(regular) * 1e3) if len(regular) > 1 else None
        row["latency_s"] = float(np.median(arrival - stamp) * S_PER_NS)
        del apart_ns, steps, regular
        found = sampling(stamp)
        if readings.sampled and found.missing is None:
            remarks.append(f"its stamps {found.how}, so how many samples are missing cannot be told")
        elif readings.sampled and found.missing:
            remarks.append(f"{counted(found.missing, 'sample')} missing ({found.share:.1%})")
    row["note"] = "; ".join(remarks) or None
    return row


def _behind(stamp: IntArray) -> int:
    """How many stamps are earlier than the newest stamp before them."""
    return int(np.sum(stamp[1:] < np.maximum.accumulate(stamp)[:-1])) if len(stamp) > 1 else 0


def clock_went_back(readings: Readings) -> float | None:
    """By how many seconds a clock was set back during the recording; None if none was.

    Late messages come singly; a clock that was set back runs through the same times a second time. The recorder's clock
    is checked in the order of the file, the sender's in order of arrival.
    """
    order = np.argsort(readings.arrival_ns, kind="stable")
    for times in (readings.arrival_ns, readings.stamp_ns[order]):
        if len(times) < 2 * _STEP_BACK_MIN:
            continue
        newest = np.maximum.accumulate(times)
        behind = np.concatenate([[False], times[1:] < newest[:-1], [False]])
        edges = np.flatnonzero(np.diff(behind.astype(np.int8)))
        for begin, end in zip(edges[::2] + 1, edges[1::2] + 1, strict=True):
            run = times[begin:end]
            if len(run) < _STEP_BACK_MIN or int((times[:begin] > run[0]).sum()) < _STEP_BACK_MIN:
                continue
            apart = _STEP_BACK_MIN // 2  # single late messages within the run do not turn its direction
            if np.mean(run[apart:] > run[:-apart]) > _FORWARDS:
                return float((newest[begin - 1] - run[0]) * S_PER_NS)
    return None

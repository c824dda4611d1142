"""A study's recordings as a BIDS dataset of motion, for MNE-BIDS, FieldTrip and archives that ask for it.

Every stream keeps its own samples: nothing is resampled. When each was measured and when it arrived stand beside it as
channels of type LATENCY, in seconds from the recording's onset. (bids-specification.readthedocs.io, Motion)
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pandas as pd

from pipeline.analysis.comparisons import people_of
from pipeline.commands.export_bids.channels import tracks_of
from pipeline.commands.export_bids.dataset import write_dataset
from pipeline.commands.export_bids.events import EVENT_COLUMNS, OF_BIDS, events_of
from pipeline.commands.export_bids.files import descriptions, write_json, write_tsv
from pipeline.commands.export_bids.names import Names, labels, names_of
from pipeline.engine.result import Result
from pipeline.errors import PipelineError
from pipeline.study.session import Session

TASK = "selection"
_NS_PER_US = 1000


def as_bids(result: Result, folder: Path) -> int:
    """Write the dataset; how many files it has."""
    if not result.sessions:
        raise PipelineError(f"{result.name}: has no logs to export")
    for stale in folder.glob("sub-*"):
        shutil.rmtree(stale)
    people = labels([str(session.participant) for session in result.sessions])
    scans: dict[str, list[dict[str, str]]] = {}
    for name, session in zip(names_of(result.sessions, people), result.sessions, strict=True):
        scans.setdefault(name.subject, []).extend(_write_session(result, session, name, folder))
    for subject, rows in scans.items():
        write_tsv(folder / f"sub-{subject}" / f"sub-{subject}_scans.tsv", pd.DataFrame(rows))
    write_dataset(result.study, people, people_of(result.study, result.folder), folder)
    return sum(path.is_file() for path in folder.rglob("*"))


def _write_session(result: Result, session: Session, name: Names, folder: Path) -> list[dict[str, str]]:
    """Write one session's files; their rows in scans.tsv."""
    ingest = result.entries["ingest"][session.id].folder
    tracks = tracks_of(result.study, ingest)
    events = events_of(ingest)
    begins = [track.begin_ns for track in tracks] + ([] if events.empty else [int(events["time_ns"].min())])
    onset_ns = min(begins, default=0) // _NS_PER_US * _NS_PER_US  # scans.tsv takes microseconds
    motion = folder / f"sub-{name.subject}" / "motion"
    systems = labels([track.stream for track in tracks])
    rows = []
    for track in tracks:
        stem = name.stem(TASK, systems[track.stream])
        write_tsv(motion / f"{stem}_motion.tsv", track.samples(onset_ns), header=False)
        write_json(motion / f"{stem}_motion.json", {"TaskName": TASK, "TaskDescription": _task(result), **track.facts})
        write_tsv(motion / f"{stem}_channels.tsv", pd.DataFrame(track.channels))
        write_json(motion / f"{stem}_channels.json", _channel_facts(result.study.axes))
        rows.append({"filename": f"motion/{stem}_motion.tsv", "acq_time": _moment(onset_ns)})
    if not events.empty:
        own = events.assign(onset=(events["time_ns"] - onset_ns) / 1e9, duration=None)
        stem = name.stem(TASK)
        write_tsv(motion / f"{stem}_events.tsv", own[list(EVENT_COLUMNS)])
        write_json(
            motion / f"{stem}_events.json",
            descriptions({key: about for key, about in EVENT_COLUMNS.items() if key not in OF_BIDS}),
        )
    return rows


def _task(result: Result) -> str:
    return f"Selecting targets with a hand-held display ({result.study.title or result.name})"


def _moment(onset_ns: int) -> str:
    since = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=onset_ns // _NS_PER_US)
    return since.strftime("%Y-%m-%dT%H:%M:%S.%fZ")


def _channel_facts(axes: Sequence[str]) -> dict[str, Any]:
    return {
        "reference_frame": {
            "Description": "The frame in which a channel's values are given.",
            "Levels": {
                "tracker": {"Description": f"The tracker's own frame; the study judges its axes {', '.join(axes)}."},
                "body": {"Description": "The axes of the phone."},
            },
        }
    }

"""A study's sessions as logs for Foxglove, Lichtblick, Rerun and PlotJuggler: readings, events and every track.

Positions are written as poses, which all of these draw in space; their orientation is that of the frame and says
nothing.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.engine.result import Result
from pipeline.errors import PipelineError
from pipeline.sessions.logs.mcap import Message, in_order, write
from pipeline.study.session import Session
from pipeline.study.settings import Study
from pipeline.tables import table as tables

LAYOUT = "layout.json"
TRACKS = "/steadyhand/"
"""What the topics of tracks begin with; an estimator's name follows."""
_M_PER_MM = 0.001
_AXES = ("x", "y", "z")


def as_mcap(result: Result, folder: Path) -> int:
    """Write a log for each session, and a layout that plots them; how many files that are."""
    if not result.sessions:
        raise PipelineError(f"{result.name}: has no logs to export")
    for session in result.sessions:
        ingest, fuse = (result.entries[name][session.id].folder for name in ("ingest", "fuse"))
        messages = in_order([*_readings(result.study, ingest), *_tracks(fuse), *_events(result.study, ingest)])
        write(folder / f"{session.id}.mcap", _facts(session), messages)
    (folder / LAYOUT).write_text(json.dumps(_layout(result.study), indent=1), encoding="utf-8")
    return len(result.sessions) + 1


def _facts(session: Session) -> dict[str, str]:
    return {name: value for name, value in session.ids.items() if value is not None}


def _readings(study: Study, ingest: Path) -> Iterator[Message]:
    """Readings as ingest has them: in SI units again, with their stamps and times of arrival."""
    for row in tables.read_arrow("positions", ingest).to_pylist():
        values = np.array([row[f"{axis}_mm"] for axis in _AXES]) * _M_PER_MM
        yield Message(_topic(study, row), "pose", row["time_ns"], row["arrival_ns"], values)
    for row in tables.read_arrow("imu", ingest).to_pylist():
        force = [row[f"a{axis}_mm_s2"] * _M_PER_MM for axis in _AXES]
        rest = [row[f"g{axis}_rad_s"] for axis in _AXES] + [row[f"q{axis}"] for axis in "xyzw"]
        values = np.array([*force, *(np.nan if figure is None else figure for figure in rest)])
        yield Message(_topic(study, row), "acceleration", row["time_ns"], row["arrival_ns"], values)


def _topic(study: Study, row: dict[str, Any]) -> str:
    """A stream's topic; where several streams read one topic, each has its own."""
    name = row["stream"]
    topic = study.streams[name].topic
    shared = sum(stream.topic == topic for stream in study.streams.values()) > 1
    return f"{topic.rstrip('/')}/{name}" if shared else topic


def _tracks(fuse: Path) -> Iterator[Message]:
    """What each estimator showed, and when."""
    for row in tables.read_arrow("tracks", fuse).to_pylist():
        values = np.array([0.0 if row[f"{axis}_mm"] is None else row[f"{axis}_mm"] for axis in _AXES]) * _M_PER_MM
        yield Message(f"{TRACKS}{row['estimator']}", "pose", row["time_ns"], row["time_ns"], values)


def _events(study: Study, ingest: Path) -> Iterator[Message]:
    topic = study.events.topic if study.events is not None else "/events"
    for row in tables.read_arrow("events", ingest).to_pylist():
        places = {
            key: row[f"{key}_mm"] * _M_PER_MM
            for key in (*(f"target_{axis}" for axis in _AXES), *_AXES)
            if row[f"{key}_mm"] is not None
        }
        trial = {} if row["trial"] is None else {"trial": row["trial"]}
        event = {"type": row["type"], **trial, **places}
        yield Message(topic, "events", row["time_ns"], row["time_ns"], event=event)


def _layout(study: Study) -> dict[str, Any]:
    """A layout of Foxglove and Lichtblick: x of every track and of the reference over time, and all in space."""
    positions = [one.topic for one in study.streams.values() if one.kind in ("position", "reference", "display")]
    shown = [*dict.fromkeys(positions), *(f"{TRACKS}{name}" for name in study.estimators)]
    plots = {
        f"Plot!{axis}": {
            "title": f"{axis} in m",
            "paths": [
                {"value": f"{topic}.pose.position.{axis}", "enabled": True, "timestampMethod": "headerStamp"}
                for topic in shown
            ],
            "showLegend": True,
            "isSynced": True,
        }
        for axis in study.axes
    }
    space = {"3D!space": {"topics": {topic: {"visible": True} for topic in shown}, "followTf": "tracker"}}
    panels = [*plots, *space]
    layout: Any = panels[-1]
    for panel in reversed(panels[:-1]):
        layout = {"first": panel, "second": layout, "direction": "column", "splitPercentage": 40}
    return {"configById": {**plots, **space}, "globalVariables": {}, "userNodes": {}, "layout": layout}

"""The paths of the hand past the targets: one session in full, then every participant."""

from __future__ import annotations

import pandas as pd

from pipeline.report import figures
from pipeline.report.document.model import Block, Section
from pipeline.report.figures.plane import Plane
from pipeline.report.figures.style import BLACK, colour
from pipeline.report.prose.accuracy_claims import without_reference
from pipeline.report.sections.material import Material, first_of

_SESSIONS_MAX = 48  # drawn; a page of more would be slow to open
_READ = ("tracks", "positions", "events")
_STEP = 4  # of a track's rows in small panels: no eye sees more


def section(material: Material) -> Section | None:
    """Hand paths; None where nothing moves in a plane."""
    used, axes = material.used(), material.study.axes
    if not used or len(axes) < 2 or not material.study.estimators:
        return None
    plane = (axes[0], axes[1])
    blocks = _first_session(material, used, plane)
    if blocks and len(used) > 1:
        blocks += _every_participant(material, used, plane)
    return Section("paths", "Hand paths", tuple(blocks)) if blocks else None


def _first_session(material: Material, used: list[int], plane: Plane) -> list[Block]:
    """The first session: the reference, what was displayed, and what the best fusion makes of it."""
    tracks, positions, events = (material.thinned(name, used[0]) for name in _READ)
    lines = [material.study.stream_of_kind("reference"), displayed(material, used[0]), best_estimator(material)]
    recorded = {*positions["stream"], *tracks["estimator"]}
    shown = [line for line in dict.fromkeys(lines) if line in recorded]
    if not shown:
        return []
    return [material.drawn("path", figures.path, tracks, positions, events, shown, plane, _looks(material, used[0]))]


def _looks(material: Material, place: int) -> dict[str, str]:
    """Estimators and what a session displayed in the colours of other figures: of its condition, of themselves."""
    study, condition = material.study, material.sessions[place].condition
    looks = {name: colour(at) for at, name in enumerate(study.estimators)}
    reference, display = study.stream_of_kind("reference"), study.stream_of_kind("display")
    if reference is not None:
        looks[reference] = BLACK
    if display is not None and condition in study.conditions:
        looks[display] = colour(study.conditions.index(condition))
    return looks


def _every_participant(material: Material, used: list[int], plane: Plane) -> list[Block]:
    """What each session displayed, one panel per participant."""
    line_of, more = {}, first_of(_SESSIONS_MAX, len(used), "sessions")
    used = used[:_SESSIONS_MAX]
    for place in used:
        line, condition = displayed(material, place), material.sessions[place].condition
        if line is not None and condition is not None:
            line_of[condition] = line
    ordered = {condition: line_of[condition] for condition in material.study.conditions if condition in line_of}
    if not ordered:
        return []
    parts: dict[str, list[pd.DataFrame]] = {name: [] for name in _READ}
    for place in used:
        tracks, positions, events = (material.thinned(name, place) for name in _READ)
        parts["tracks"].append(tracks[tracks["estimator"].isin(line_of.values())].iloc[::_STEP])
        parts["positions"].append(positions[positions["stream"].isin(line_of.values())].iloc[::_STEP])
        parts["events"].append(events)
    sessions = pd.DataFrame([material.sessions[place].ids for place in used])
    joined = [pd.concat(parts[name]) for name in _READ]
    return [
        material.drawn("paths", figures.paths, *joined, sessions, ordered, plane, material.study.conditions, more=more)
    ]


def displayed(material: Material, place: int) -> str | None:
    """What a session showed: its display's stream, else the estimator it names, else the tracker."""
    study = material.study
    condition = material.sessions[place].condition or ""
    return study.stream_of_kind("display") or study.shown.get(condition) or study.tracker


def best_estimator(material: Material) -> str | None:
    """The estimator with the least error; the last one where errors are not known."""
    rows = [row for row in material.rows("accuracy_means") if row["rmse_mm"] is not None]
    if rows and not without_reference(material.results):
        return str(min(rows, key=lambda row: row["rmse_mm"])["estimator"])
    return list(material.study.estimators)[-1]

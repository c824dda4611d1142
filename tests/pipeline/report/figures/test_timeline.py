"""What arrived when: silences, events and sessions set aside."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from pipeline.report import figures
from pipeline.report.figures.timeline import silences
from pipeline.tables import table as tables
from tests.pipeline.report.figures.drawn import pictures, saved, texts

SECOND = 1_000_000_000


def rates(session: str, stream: str, messages: list[int], gaps_s: dict[int, float]) -> list[dict[str, object]]:
    return [
        {
            "session": session,
            "stream": stream,
            "time_ns": 10**18 + place * SECOND,
            "duration_s": 1.0,
            "messages": count,
            "gap_max_s": gaps_s.get(place, 1 / 30),
        }
        for place, count in enumerate(messages)
    ]


RATES = tables.frame(
    "stream_rates",
    [
        *rates("P1_a", "tracker", [30, 30, 30, 4, 30], {3: 0.87, 1: 0.1}),
        *rates("P1_a", "<imu>", [90] * 5, {}),
        *rates("P2_a", "tracker", [0] * 5, dict.fromkeys(range(5), 0.0)),
    ],
)
EVENTS = tables.frame(
    "events",
    [
        {"session": "P1_a", "time_ns": 10**18 + SECOND, "type": "trial_start", "trial": 1},
        {"session": "P1_a", "time_ns": 10**18 + 2 * SECOND, "type": "selection", "trial": 1},
    ],
)
ASIDE = tables.frame("exclusions", [{"session": "P9_a", "what": "session set aside", "reason": "cut"}])


def test_silences_are_of_the_stream_s_own_step() -> None:
    found = silences(RATES)
    assert found[["session", "stream"]].to_numpy().tolist() == [["P1_a", "tracker"]]
    assert found["begin_s"].tolist() == [3.0]


def test_every_stream_has_a_row_and_what_was_set_aside_is_there(tmp_path: Path) -> None:
    shown = texts(figures.timeline(RATES, EVENTS, ASIDE), tmp_path)
    assert {"P1_a  tracker", "<imu>", "P2_a  tracker", "P9_a  set aside", "silence", "selection"} <= set(shown)
    assert "Time since the session's first message (s)" in shown
    said = figures.timeline.words(RATES, EVENTS, ASIDE).caption
    assert "2 sessions, 1 stretch with a silence, the longest 0.87 s (P1_a, tracker); 1 session set aside." in said


def test_nothing_befell(tmp_path: Path) -> None:
    calm = RATES[RATES["stream"] == "<imu>"]
    saved(figures.timeline(calm, EVENTS[:0], ASIDE[:0]), tmp_path)
    assert "0 stretches with a silence; none set aside" in figures.timeline.words(calm, EVENTS, ASIDE[:0]).caption


def test_a_long_study_stays_small(tmp_path: Path) -> None:
    uneven = [30 if place % 2 else 15 for place in range(120)]
    long = tables.frame("stream_rates", [row for n in range(24) for row in rates(f"P{n}_a", "t", uneven, {})])
    path = saved(figures.timeline(long, EVENTS, ASIDE), tmp_path)
    assert pictures(path) == 1
    assert path.stat().st_size < 300_000
    steady = pd.concat([long.assign(messages=30)])
    assert pictures(saved(figures.timeline(steady, EVENTS, ASIDE), tmp_path)) == 0

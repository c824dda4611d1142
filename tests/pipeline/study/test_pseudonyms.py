"""Pseudonyms: who gets which, and what is replaced in a text."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from pipeline.errors import PipelineError
from pipeline.study.pseudonyms import pseudonyms_of
from pipeline.study.session import Session
from tests.pipeline.helpers import Steadyhand

ROOT = Path("/somewhere/study")


def _log(name: str, participant: str | None, condition: str | None, *parts: str) -> Session:
    path = ROOT / "data" / name
    return Session(path.stem, participant, condition, path, tuple(path / part for part in parts))


def test_people_are_numbered_in_the_order_of_their_ids_and_logs_are_named_after_them() -> None:
    logs = [_log("zoe_b.mcap", "zoe", "b"), _log("ann_a.mcap", "ann", "a"), _log("who.mcap", None, None)]
    names = pseudonyms_of(logs, [("mia", "a", None)], "data/{participant}_{condition}.mcap", ROOT)
    assert names.participants == {"ann": "P01", "mia": "P02", "zoe": "P03"}
    assert names.sessions == {"ann_a": "P01_a", "zoe_b": "P03_b", "who": "unknown"}
    assert names.files == {
        "data/ann_a.mcap": "data/P01_a.mcap",
        "data/zoe_b.mcap": "data/P03_b.mcap",
        "data/who.mcap": "data/unknown.mcap",
    }


def test_sessions_of_one_cell_are_numbered_and_the_parts_of_a_log_too() -> None:
    logs = [_log("ann", "ann", "a", "ann 1.mcap.zst", "ann 2.mcap.zst"), _log("ann2", "ann", "a", "x.mcap")]
    names = pseudonyms_of(logs, [], "data/{session}", ROOT)
    assert names.sessions == {"ann": "P01_a_1", "ann2": "P01_a_2"}
    assert list(names.files.values()) == ["data/P01_a_1/1.mcap.zst", "data/P01_a_1/2.mcap.zst", "data/P01_a_2/1.mcap"]
    assert names.in_text('ann 2.mcap.zst: cut off; its name says "ann", its metadata "eve"', ["eve"]) == (
        '2.mcap.zst: cut off; its name says "P01", its metadata "someone else"'
    )


def test_a_session_that_several_people_share_tells_of_nobody() -> None:
    rows = [("ann", "a", "morning"), ("zoe", "a", "morning"), ("zoe", "b", "zoe's own")]
    assert pseudonyms_of([], rows, "", ROOT).sessions == {"zoe's own": "P02_b"}


def test_more_than_99_people_have_numbers_of_one_length() -> None:
    names = pseudonyms_of([], [(f"id{n}", None, None) for n in range(100)], "", ROOT)
    assert {len(name) for name in names.participants.values()} == {4}


def test_ids_are_found_in_texts_as_whole_words_and_short_ones_in_quotes_alone() -> None:
    names = pseudonyms_of([], [("maria", "a", None), ("7", "a", None), ("P1", "a", None)], "", ROOT)
    assert names.in_text('maria slept, mariachi played; 7 of 7 trials of "7" and P1') == (
        'P03 slept, mariachi played; 7 of 7 trials of "P01" and P1'
    )


def test_a_table_with_somebody_new_is_another_one_than_the_pseudonyms_were_made_for() -> None:
    names = pseudonyms_of([], [("ann", "a", None)], "", ROOT)
    with pytest.raises(PipelineError, match=r"t\.csv: changed while it was read") as raised:
        names.in_table(pd.DataFrame({"participant": ["ann", "eve"]}), Path("t.csv"))
    assert "eve" not in str(raised.value)


def test_an_exclusion_of_somebody_unknown_is_said_without_the_id(
    folder: Callable[..., Path], steadyhand: Steadyhand
) -> None:
    study = folder(
        "conditions: [a, b]\nmeasures: m.csv\nexclusions: [{participant: Trilian, reason: late}]\n",
        **{"m.csv": "participant,condition,measure,value\nTrillian,a,m,1\nTrillian,b,m,2\n"},
    )
    ran = steadyhand("compare", study, "--anonymise")
    assert ran.code == 2
    assert "exclusions: entry 1 names a participant that is not in the data; correct it, or run the command" in ran.err
    assert "ril" not in ran.err

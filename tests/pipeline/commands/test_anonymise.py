"""`--anonymise`: no id of a participant is in anything that is written or printed, and every number is the same."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from pypdf import PdfReader

from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.helpers import Steadyhand

PEOPLE = ("Zaphod7", "trillian-42", "Ford Prefect", "Ärthur")
STRANGERS = ("Slartibartfast", "Marvin9", "Agrajag", "Eddie")
"""Who stands in a file's name or in a log alone."""
SETTINGS = (
    """
title: A study with Zaphod7
notes: trillian-42 wore glasses.
conditions: [a, b]
sessions: data/{participant}_{condition}.mcap
participants: people.csv
trials: trials.csv
questionnaires: answers.csv
measures: values/{participant}.csv
estimators: {raw: {type: raw}}
comparisons: [{test: t_paired, measure: "*"}]
exclusions:
  - {participant: Ford Prefect, measure: comfort, reason: Ford Prefect fell asleep}
  - {session: Ärthur_b, reason: left early}
"""
    + STREAMS
).replace("events: {topic: /events}\n", "")


def _rows(header: str, line: str) -> str:
    """A table with a row for each person, condition and trial; `line` may say `{n}`, the person's number."""
    rows = (
        line.format(person=person, each=each, trial=trial, n=number, higher=ord(each) - 96)
        for number, person in enumerate(PEOPLE)
        for each in "ab"
        for trial in ((1, 2) if "{trial}" in line else (1,))
    )
    return "\n".join([header, *rows]) + "\n"


@pytest.fixture
def study(folder: Callable[..., Path]) -> Path:
    """Ids in every table, in the names of logs and of files beside them, in a log's metadata, in texts and faults."""
    root = folder(
        SETTINGS,
        **{
            "people.csv": "participant,age\n"
            + "".join(f"{person},2{number}\n" for number, person in enumerate(PEOPLE)),
            "trials.csv": _rows(
                "participant,condition,session,trial,target_x_mm,target_y_mm,selected_x_mm,selected_y_mm",
                "{person},{each},{person}_{each},{trial},0,0,{trial}{n},{higher}",
            ),
            "answers.csv": _rows(
                "participant,condition,questionnaire,scale,rating", "{person},{each},ease,total,{higher}{n}"
            ),
        },
    )
    (root / "values").mkdir()
    for number, person in enumerate(PEOPLE):  # a table that is split: the ids are in the names of its files alone
        rows = "".join(f"{each},comfort,{number}{ord(each) - 96}{number}\n" for each in "ab")
        (root / "values" / f"{person}.csv").write_text("condition,measure,value\n" + rows, encoding="utf-8")
    for person in PEOPLE[:2]:
        for condition in "ab":
            write_session(root / "data" / f"{person}_{condition}.mcap", session_messages(2.5), participant=person)
    whole = (root / "data" / "Zaphod7_b.mcap").read_bytes()
    (root / "data" / "Zaphod7_b.mcap").write_bytes(whole[: len(whole) * 4 // 5])  # read in part
    write_session(root / "data" / "Ärthur_b.mcap", session_messages(2.5))
    write_session(root / "data" / "Ford Prefect_a.mcap", session_messages(2.5), participant="Agrajag")
    (root / "data" / "Marvin9_a.mcap").write_bytes(b"no log")
    (root / "data" / "Slartibartfast.mcap").write_bytes(b"")
    (root / "data" / "Eddie_a.mcap").mkdir()
    return root


def texts_of(folder: Path) -> Iterator[tuple[str, str]]:
    """Every file of a folder by its name, and every file within a ZIP; of a PDF and of Parquet what they say."""
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            yield from _texts(path.relative_to(folder).as_posix(), path.read_bytes())


def _texts(name: str, content: bytes) -> Iterator[tuple[str, str]]:
    yield name, name + content.decode("utf-8", "replace")
    if name.endswith(".zip"):
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            for inside in archive.namelist():
                yield from _texts(inside, archive.read(inside))
    if name.endswith(".pdf"):
        yield name, _printed(content)
    if name.endswith(".parquet"):
        yield name, str(pq.read_table(io.BytesIO(content)).to_pylist())


@cache
def _printed(pdf: bytes) -> str:
    """A document's facts and text; the one in a ZIP is the one beside it."""
    reader = PdfReader(io.BytesIO(pdf))
    return " ".join([str(reader.metadata), *(page.extract_text() for page in reader.pages)])


def _numbers(value: Any) -> Any:
    """A result without its texts."""
    if isinstance(value, dict):
        return {key: _numbers(each) for key, each in value.items() if not isinstance(each, str)}
    if isinstance(value, list):
        return [_numbers(each) for each in value if not isinstance(each, str)]
    return value


@pytest.mark.slow
def test_no_id_is_in_anything_that_is_written_or_printed(study: Path, steadyhand: Steadyhand) -> None:
    plain = steadyhand("report", study)
    assert plain.code == 1, plain.err
    everything = dict(texts_of(steadyhand.out))
    for person in (*PEOPLE, *STRANGERS):
        assert any(person in content for content in everything.values()), person  # else this test shows nothing
    with_ids = {path.name: path.read_bytes() for path in steadyhand.out.rglob("*") if path.is_file()}
    numbers = _numbers(steadyhand.results())

    hidden = steadyhand("report", study, "--anonymise")
    assert plain.code == hidden.code == 1
    assert _numbers(steadyhand.results()) == numbers
    left_out = {row["session"] for row in steadyhand.results()["exclusions"]}
    assert {"P01_a", "P02_a", "P03_b", "P05_b", "data/unreadable_1.mcap", "data/other_1.mcap"} <= left_out
    written = [*texts_of(steadyhand.out), ("console", hidden.out + hidden.err)]
    for kind in ("csv", "parquet", "mcap", "r", "bids"):
        steadyhand.out = steadyhand.out.with_name(f"as-{kind}")
        exported = steadyhand("export", study, "--to", kind, "--anonymise")
        written += [*texts_of(steadyhand.out), ("console", exported.out + exported.err)]
    for name, content in written:
        for person in (*PEOPLE, *STRANGERS):
            assert person not in content, (name, person)
    steadyhand.out = steadyhand.out.with_name("again")
    assert steadyhand("report", study).code == 1
    assert {path.name: path.read_bytes() for path in steadyhand.out.rglob("*") if path.is_file()} == with_ids

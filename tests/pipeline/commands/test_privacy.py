"""What is handed on says nothing of the machine it was made on, and is the same wherever it is made."""

from __future__ import annotations

import io
import json
import os
import platform
import shutil
import socket
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from pypdf import PdfReader

from pipeline.engine import executors, processes
from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.helpers import Steadyhand, run

SETTINGS = (
    "conditions: [a, b]\nsessions: data/{participant}_{condition}.mcap\nestimators: {raw: {type: raw}}\n"
    "measures: m.csv\n" + STREAMS
)


@pytest.fixture
def study(folder: Callable[..., Path]) -> Path:
    """A study with a log that cannot be read and a file that is not used, so that their reasons are in the report."""
    rows = "participant,condition,measure,value\n" + "".join(f"P{p},{c},m,{p}\n" for p in range(3) for c in "ab")
    root = folder(SETTINGS, **{"m.csv": rows})
    for condition in "ab":
        write_session(root / "data" / f"P1_{condition}.mcap", session_messages(2.5))
    (root / "data" / "P2_a.mcap").write_bytes(b"no log")
    (root / "data" / "notes.mcap").write_bytes(b"")
    return root


def _contents(archive: bytes) -> Iterator[tuple[str, bytes]]:
    """Each file of the ZIP by name; of a PDF what its objects hold, unpacked."""
    with zipfile.ZipFile(io.BytesIO(archive)) as opened:
        for name in opened.namelist():
            content = opened.read(name)
            yield name, content
            if name.endswith(".pdf"):
                reader = PdfReader(io.BytesIO(content))
                yield f"{name}: facts", repr(reader.metadata).encode()
                yield f"{name}: text", "".join(page.extract_text() for page in reader.pages).encode()


@pytest.mark.usefixtures("blank_figures")
def test_the_same_study_gives_the_same_archive_anywhere_and_it_names_no_place(
    study: Path,
    steadyhand: Steadyhand,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert steadyhand("report", study).code == 1
    here = (steadyhand.out / "report.zip").read_bytes()
    elsewhere = tmp_path / "elsewhere-as-zaphod"
    shutil.copytree(study, elsewhere / "study", copy_function=shutil.copy)  # with other times
    for name, value in {"HOME": str(elsewhere), "USER": "zaphod", "LOGNAME": "zaphod", "TZ": "Asia/Tokyo"}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(platform, "node", lambda: "heart-of-gold")
    monkeypatch.setattr(socket, "gethostname", lambda: "heart-of-gold")
    # One that was forked from a process of an earlier test would have that one's home, user and time zone.
    monkeypatch.setattr(executors, "starting_with", lambda _modules: processes.SPAWN)
    time.tzset()
    monkeypatch.chdir(elsewhere / "study")
    before = os.umask(0o077)
    try:
        words = ("--out", "../out", "--cache", elsewhere / "cache", "--jobs", "2")
        assert run(capsys, monkeypatch, "report", ".", *words).code == 1
    finally:
        os.umask(before)
        monkeypatch.undo()
        time.tzset()
    there = (elsewhere / "out" / "report.zip").read_bytes()
    for (name, content), (other_name, other) in zip(_contents(here), _contents(there), strict=True):
        assert name == other_name
        assert content == other, name
        for place in (str(tmp_path), str(Path.home()), "heart-of-gold", "zaphod"):
            assert place.encode() not in content, (name, place)
    assert here == there
    made = json.loads((elsewhere / "out" / "provenance.json").read_text())
    assert made["command"] == ["steadyhand", "report", "study"]

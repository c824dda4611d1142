"""Files that were made to mislead: they steer neither the terminal nor what is written or removed."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.commands import console
from pipeline.words.phrases import one_line
from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.helpers import Steadyhand, run

Folder = Callable[..., Path]
ROWS = "participant,condition,measure,value\n" + "".join(f"P{p},{c},m,{p}\n" for p in range(3) for c in "ab")
HALF = '{"schema_version": 1, "study": {"name": "\\ud800"}}'


@pytest.fixture
def study(folder: Folder) -> Path:
    return folder("conditions: [a, b]\nmeasures: m.csv\n", **{"m.csv": ROWS})


def test_half_a_character_in_expected_json_and_results_json_is_said(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (study / "expected.json").write_text('{"\\ud800": 1}')
    ran = run(capsys, monkeypatch, "check", study, "--cache", tmp_path / "cache", "--jobs", "1")
    assert ran.code == 2
    assert "expected.json: holds half of a surrogate pair" in ran.err
    (tmp_path / "results.json").write_text(HALF)
    ran = run(capsys, monkeypatch, "diff", tmp_path, tmp_path)
    assert ran.code == 2
    assert "results.json: holds half of a surrogate pair" in ran.err
    (tmp_path / "results.json").write_text(HALF.replace("\\ud800", "\\ud83d\\ude00"))
    assert run(capsys, monkeypatch, "diff", tmp_path, tmp_path).code == 0


@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_only_files_of_a_report_are_removed_whatever_its_provenance_lists(study: Path, steadyhand: Steadyhand) -> None:
    assert steadyhand("report", study).code == 0
    mine = steadyhand.out / "mine.txt"
    mine.write_text("a file of the user's")
    provenance = steadyhand.out / "provenance.json"
    made = json.loads(provenance.read_text())
    made["files"] += ["tables/../mine.txt", "tables/../../outside.txt"]
    provenance.write_text(json.dumps(made))
    (steadyhand.out.parent / "outside.txt").write_text("another")
    assert steadyhand("report", study, "--format", "json").code == 0
    assert mine.read_text() == "a file of the user's"
    assert (steadyhand.out.parent / "outside.txt").is_file()


@pytest.mark.usefixtures("blank_figures", "blank_print")
@pytest.mark.parametrize(("name", "root"), [("..\\..\\x", "_.._x"), ("C:y", "C_y"), ("a study", "a study")])
def test_the_archive_unpacks_below_one_folder_everywhere(
    folder: Folder, steadyhand: Steadyhand, name: str, root: str
) -> None:
    study = folder("conditions: [a, b]\nmeasures: m.csv\n", name=name, **{"m.csv": ROWS})
    assert steadyhand("report", study).code == 0
    with zipfile.ZipFile(steadyhand.out / "report.zip") as archive:
        assert {entry.split("/")[0] for entry in archive.namelist()} == {root}


def test_what_is_printed_is_neither_turned_round_nor_more_lines_than_it_is() -> None:
    assert console.printable("a\u202egpj.exe\u2066\u2028b\x1b[2J\udcff") == "a□gpj.exe□□b□[2J□"
    assert console.printable("مرحبا, é, 手, two\nlines") == "مرحبا, é, 手, two\nlines"
    assert one_line("a\nb") == "a□b"


def test_a_line_break_in_a_log_begins_no_line(folder: Folder, steadyhand: Steadyhand) -> None:
    root = folder("conditions: [a]\nsessions: data/{session}.mcap\nestimators: {raw: {type: raw}}\n" + STREAMS)
    forged = "a\nstudy: all 12 numbers as expected"
    write_session(root / "data" / "s1.mcap", session_messages(2.5), participant="P1", condition=forged)
    write_session(root / "data" / "s2.mcap", session_messages(2.5), participant="P2", condition="a")
    ran = steadyhand("compare", root)
    assert ran.code == 1
    assert "all 12 numbers as expected" in ran.err
    assert not any(line.startswith("study: all") for line in (ran.out + ran.err).splitlines())


@pytest.mark.parametrize("column", ["selected_x_mm", "target_y_mm", "start_s", "selection_s", "target_width_mm"])
def test_an_infinite_place_or_time_of_a_trial_is_named_with_the_remedy(
    folder: Folder, steadyhand: Steadyhand, column: str
) -> None:
    columns = "participant,condition,trial,target_x_mm,target_y_mm,selected_x_mm,selected_y_mm,start_s,selection_s,"
    header = (columns + "target_width_mm").split(",")
    row = dict(zip(header, ["P1", "a", "1", "0", "0", "1", "1", "0", "1", "9"], strict=True))
    text = "\n".join([",".join(header), ",".join((row | {column: "-inf"}).values())]) + "\n"
    settings = "conditions: [a]\ntrials: trials.csv\n"
    ran = steadyhand("compare", folder(settings, **{"trials.csv": text}))
    assert ran.code == 2
    assert f'row 2: "{column}" should be a number that is finite, found "-inf" (if that stands for a missing' in ran.err
    assert steadyhand("compare", folder(settings + "missing: ['-inf']\n", **{"trials.csv": text})).code == 0


def test_the_version_is_printed(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    ran = run(capsys, monkeypatch, "--version")
    assert (ran.code, ran.out.split()[0]) == (0, "steadyhand")


def test_a_file_that_cannot_be_written_is_blamed_on_the_option_that_moves_it(
    study: Path,
    tmp_path: Path,
    steadyhand: Steadyhand,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    ran = run(capsys, monkeypatch, "compare", study, "--out", blocked / "out", "--cache", steadyhand.cache)
    assert (ran.code, ran.err.splitlines()[-1].partition(": ")[2]) == (
        2,
        f"{blocked / 'out'}: Not a directory; choose another place with --out",
    )
    ran = run(capsys, monkeypatch, "compare", study, "--out", steadyhand.out, f"--cache={blocked}/cache")
    assert ran.code == 2
    assert ran.err.endswith("choose another place with --cache\n")


def test_a_file_of_the_users_that_cannot_be_read_is_blamed_on_no_option(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    ran = run(capsys, monkeypatch, "diff", tmp_path / "none.json", tmp_path / "none.json")
    assert ran.code == 2
    assert "--" not in ran.err

"""`steadyhand new`: what it writes passes `report` at once, every line has a comment, and nothing is overwritten."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import openpyxl  # type: ignore[import-untyped]
import pytest

from pipeline.commands.new import proposed
from pipeline.commands.new.found import Stated
from pipeline.commands.new.questions import Questions
from pipeline.commands.new.templates import NAMES
from pipeline.errors import PipelineError
from pipeline.study.folder import load_study
from tests.conftest import write_session
from tests.pipeline.commands.new_study import CASES, TLX_HEADER, New, assert_commented, new, settings, written
from tests.pipeline.helpers import Steadyhand, exit_code

__all__ = ["new"]  # a fixture


@pytest.mark.parametrize(
    ("case", "n"),
    [
        ("between", 24),
        ("cp1252", 8),
        ("german_spreadsheet", 8),
        ("milliseconds", 8),
        ("minus99", 9),
        ("mixed_design", 10),
        ("practice", 8),
        ("tlx_wide_weights", 12),
        ("wide", 10),
    ],
)
def test_what_people_bring_goes_from_new_to_results(
    tmp_path: Path, new: New, steadyhand: Steadyhand, case: str, n: int
) -> None:
    study = tmp_path / case
    shutil.copytree(CASES / case, study, ignore=shutil.ignore_patterns("study.yaml"))
    made = new(study)
    assert made.code == 0
    assert f"Next: steadyhand report {study}" in made.out
    assert_commented(study)
    assert steadyhand("compare", study).code == 0
    rows = steadyhand.results()["comparisons"]
    assert max(row["n"] for row in rows) == n
    assert {row["status"] for row in rows} == {"ok"}


@pytest.mark.parametrize("template", NAMES)
@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_a_template_passes_report_at_once(tmp_path: Path, new: New, steadyhand: Steadyhand, template: str) -> None:
    study = tmp_path / "study"
    assert new(study, "--template", template).code == 0
    assert_commented(study)
    assert steadyhand("report", study, "--format", "html,json").code == 0
    assert {row["status"] for row in steadyhand.results()["comparisons"]} == {"ok"}
    assert load_study(study).data_origin == "simulated"


def test_nothing_is_ever_overwritten(tmp_path: Path, new: New) -> None:
    study = written(tmp_path / "study", "study.yaml", "mine")
    for words in ((), ("--template", "tlx")):
        ran = new(study, *words)
        assert ran.code == 2
        assert "study.yaml: already exists, and is never overwritten" in ran.err
    other = written(tmp_path / "other", "questionnaires.csv", "mine")
    ran = new(other, "--template", "tlx")
    assert ran.code == 2
    assert "questionnaires.csv: already exists" in ran.err
    assert not (other / "study.yaml").exists()
    assert (other / "questionnaires.csv").read_text(encoding="utf-8") == "mine"


def test_a_folder_without_anything_names_the_templates(tmp_path: Path, new: New) -> None:
    ran = new(written(tmp_path / "study", "notes.txt", "nothing here\n"))
    assert ran.code == 2
    assert "and no tables that a study can use" in ran.err
    assert "--template peephole (or tlx, fitts, between)" in ran.err
    assert new(tmp_path / "study", "--template", "fits").err.count('did you mean "fitts"?') == 1


@pytest.mark.parametrize(
    ("header", "language"),
    [
        ("Subject,Technique,Trial,Goal X (mm),Goal Y (mm),Click X (mm),Click Y (mm),Start (ms),End (ms)", "English"),
        ("Versuchsperson,Bedingung,Durchgang,ZielX_mm,ZielY_mm,AuswahlX_mm,AuswahlY_mm,Beginn_ms,Ende_ms", "German"),
        ("Sujet,Système,Essai,Cible X [mm],Cible Y [mm],Clic X [mm],Clic Y [mm],Début [ms],Fin [ms]", "French"),
        ("Sujeto,Condición,Ensayo,Objetivo X mm,Objetivo Y mm,Toque X mm,Toque Y mm,Inicio ms,Fin ms", "Spanish"),
    ],
)
def test_headers_are_understood_in_four_languages(
    tmp_path: Path, new: New, steadyhand: Steadyhand, header: str, language: str
) -> None:
    words = header.replace("Toque X mm", "Toque X (mm)").replace("Toque Y mm", "Toque Y (mm)")
    rows = "".join(
        f"{person},{condition},{trial},0,0,3,{4 + person},{1000 * trial},{1000 * trial + 500}\n"
        for person in (1, 2, 3)
        for condition in "ab"
        for trial in (1, 2)
    )
    study = written(tmp_path / language, "data.csv", f"{words}\n{rows}")
    assert new(study).code == 0
    columns = list(settings(study)["columns"]["trials"].values())
    assert columns[:3] == ["participant", "condition", "trial"] if language != "English" else "participant" in columns
    assert columns[-2:] == ["start_ms", "selection_ms"]
    assert steadyhand("compare", study).code == 0
    times = {r["mean"] for r in steadyhand.results()["descriptives"] if r["measure"] == "trial_time_s"}
    assert times == {0.5}


def test_a_workbook_with_a_title_and_german_scales_of_the_tlx(tmp_path: Path, new: New, steadyhand: Steadyhand) -> None:
    book = openpyxl.Workbook()
    sheet = book.worksheets[0]
    sheet.append(["Fragebogen Herbst"])
    sheet.append(["VP", "Bedingung", "Geistige", "Körperliche", "Zeitliche", "Leistung", "Anstrengung", "Frustration"])
    for person in (1, 2, 3):
        for condition, more in (("alt", 4), ("neu", 0)):
            sheet.append([f"VP{person}", condition, *(more + person + scale for scale in range(6))])
    study = tmp_path / "study"
    study.mkdir()
    book.save(study / "tlx.xlsx")
    assert new(study).code == 0
    made = settings(study)
    assert made["format"] == {"header_row": 2}
    assert made["scoring"] == {"nasa_tlx": {"rule": "raw_tlx", "range": [0, 20]}}
    assert steadyhand("compare", study).code == 0
    means = {
        r["condition"]: r["mean"] for r in steadyhand.results()["descriptives"] if r["measure"] == "nasa_tlx/raw_tlx"
    }
    assert means == pytest.approx({"alt": (4 + 2 + 2.5) * 5, "neu": (2 + 2.5) * 5})


@pytest.mark.parametrize(
    ("text", "words", "expected"),
    [
        (
            "id,time_a,time_b,age\nP1,3,4,20\nP2,5,6,30\n",
            ("--column", "id=participant"),
            {"columns": "time_{condition}"},
        ),
        ("subject,a,b\nP1,3,4\nP2,5,6\n", ("--conditions", "b,a"), {"condition": ["b", "a"]}),
    ],
)
def test_a_row_a_participant_with_a_column_a_condition(
    tmp_path: Path, new: New, steadyhand: Steadyhand, text: str, words: tuple[str, ...], expected: dict[str, Any]
) -> None:
    study = written(tmp_path / "study", "data.csv", text)
    assert new(study, *words).code == 0
    entry = settings(study)["wide"]["measures"]
    assert {key: sorted(entry[key]) for key in expected} == {key: sorted(value) for key, value in expected.items()}
    assert steadyhand("compare", study).code == 0
    assert steadyhand.results()["comparisons"][0]["n"] == 2


@pytest.mark.parametrize(
    ("columns", "key", "entry"),
    [
        (["t1", "t2", "t3"], "measures", {"columns": "t{trial}", "measure": "t"}),
        (
            [f"q{item}" for item in range(1, 11)],
            "questionnaires",
            {"questionnaire": "sus", "scale": [f"q{item}" for item in range(1, 11)]},
        ),
    ],
)
def test_columns_that_differ_in_a_number_are_trials_or_items(
    tmp_path: Path, new: New, steadyhand: Steadyhand, columns: list[str], key: str, entry: dict[str, Any]
) -> None:
    rows = "".join(
        f"{person},{condition},{','.join(str(1 + (person * at + len(condition)) % 5) for at in range(len(columns)))}\n"
        for person in (1, 2, 3)
        for condition in ("old", "newer")
    )
    study = written(tmp_path / "study", "data.csv", f"id,cond,{','.join(columns)}\n{rows}")
    assert new(study).code == 0
    assert settings(study)["wide"] == {key: entry}
    assert steadyhand("compare", study).code == 0
    assert steadyhand.results()["comparisons"][0]["n"] == 3


def test_tables_of_one_person_each_are_one(tmp_path: Path, new: New, steadyhand: Steadyhand) -> None:
    """What the names of the files say is not repeated in them; one that says it too must agree."""
    study = tmp_path / "study"
    for place, person in enumerate(("P01", "P02", "P03", "P04")):
        rows = f"a,{3 + place / 3}\nb,{4 + place / 2}\n"
        written(study / "times", f"{person}.csv", f"condition,time\n{rows}")
        written(study, f"tlx_{person}.csv", f"{TLX_HEADER}\n{person},a,1,2,3,4,5,6\n{person},b,2,3,4,5,6,{place}\n")
    made = new(study)
    assert made.code == 0, made.err
    assert settings(study)["measures"] == "times/{participant}.csv"
    assert settings(study)["questionnaires"] == "tlx_{participant}.csv"
    assert "describe 4 participants" in made.out
    assert_commented(study)
    assert steadyhand("compare", study).code == 0
    assert {row["n"] for row in steadyhand.results()["comparisons"]} == {4}
    (study / "times" / "P05.csv").write_text("condition,time\na,3\nb,5\n")
    assert steadyhand("compare", study).code == 0
    assert max(row["n"] for row in steadyhand.results()["comparisons"]) == 5
    (study / "tlx_P04.csv").write_text(f"{TLX_HEADER}\nP03,a,1,2,3,4,5,6\nP03,b,2,3,4,5,6,1\n")
    assert 'the rows of participant "P03" are in the file of "P04"' in steadyhand("compare", study).err
    (study / "tlx_P04.csv").write_text(f"{TLX_HEADER}\nP04,a,1,2,3,4,5,6\nP04,b,2,3,4,five,6,1\n")
    assert 'row 3 of tlx_P04.csv: "performance" should be a number' in steadyhand("compare", study).err
    (study / "times" / "P04.csv").write_text("condition,duration\na,3\nb,5\n")
    assert "have different columns (duration, time)" in steadyhand("compare", study).err


def test_tables_of_the_same_columns_and_other_names_are_to_be_joined(tmp_path: Path, new: New) -> None:
    for person in ("first_try", "second"):
        written(tmp_path / "study", f"{person}.csv", f"participant,condition,time\n{person},a,3\n{person},b,4\n")
    ran = new(tmp_path / "study")
    assert ran.code == 2
    assert "Name such files alike, as P01_measures.csv" in ran.err


QUALTRICS = """StartDate,EndDate,Status,Progress,Duration (in seconds),ResponseId,PID,kinect_Q1,fusion_Q1
Start Date,End Date,Response Type,Progress,Duration (in seconds),Response ID,Your number,"Rate it
from 1 to 7","Rate it
from 1 to 7"
"{""ImportId"":""startDate""}","{""ImportId"":""endDate""}","{""ImportId"":""status""}","{""ImportId"":""progress""}",\
"{""ImportId"":""duration""}","{""ImportId"":""_recordId""}","{""ImportId"":""QID1""}","{""ImportId"":""QID2""}",\
"{""ImportId"":""QID3""}"
""".replace("\\\n", "")


@pytest.mark.parametrize("rows", [3, 2])
def test_an_export_of_qualtrics(tmp_path: Path, new: New, steadyhand: Steadyhand, rows: int) -> None:
    """Names, questions and ImportIds stand above the answers; older exports lack the last of these."""
    header = QUALTRICS if rows == 3 else QUALTRICS[: QUALTRICS.index('"{')]
    answers = [f"2024-05-0{at},2024-05-0{at},0,100,{300 + at},R_{at},P{at},{at % 4},{at % 3 + 3}" for at in range(1, 7)]
    study = written(tmp_path / "study", "Survey_May.csv", header + "\n".join(answers) + "\n")
    made = new(study)
    assert made.code == 0, made.err
    assert settings(study)["format"] == {"header_rows": rows}
    assert settings(study)["conditions"] == ["kinect", "fusion"]
    assert steadyhand("compare", study).code == 0
    assert [row["n"] for row in steadyhand.results()["comparisons"]] == [6]
    text = (study / "study.yaml").read_text()
    if rows == 3:
        lines = [line for line in text.splitlines() if not line.startswith("format:")]
        (study / "study.yaml").write_text("\n".join(lines))
        assert "write format: {measures: {header_rows: 3}} in study.yaml" in steadyhand("compare", study).err


def test_the_questions_of_qualtrics_name_the_scales_of_the_tlx(tmp_path: Path, new: New) -> None:
    texts = ("Mental Demand", "Physical Demand", "Temporal Demand", "Performance", "Effort", "Frustration")
    header = ["StartDate", "EndDate", "Progress", "ResponseId", "PID", "System", *(f"Q7_{at}" for at in range(1, 7))]
    rows = [
        header,
        [
            "Start Date",
            "End Date",
            "Progress",
            "Response ID",
            "Number",
            "Which?",
            *(f"How much? - {one}" for one in texts),
        ],
        [f'"{{""ImportId"":""{name}""}}"' for name in header],
        *(["2024-05-01", "2024-05-01", "100", f"R{p}{c}", str(p), c, *"123456"] for p in range(1, 7) for c in "ab"),
    ]
    study = written(tmp_path / "study", "export.csv", "\n".join(map(",".join, rows)) + "\n")
    made = new(study)
    assert made.code == 0, made.err
    assert settings(study)["columns"]["questionnaires"]["Q7_1"] == "mental"
    assert settings(study)["scoring"]["nasa_tlx"]["rule"] == "raw_tlx"


def test_names_that_are_not_built_alike_are_asked_to_be(tmp_path: Path, new: New) -> None:
    write_session(tmp_path / "study" / "one.mcap")
    write_session(tmp_path / "study" / "a_b_c_d_e.mcap")
    ran = new(tmp_path / "study")
    assert ran.code == 2
    assert "name the logs P01_kinect.mcap" in ran.err


def test_on_a_terminal_only_what_cannot_be_told_is_asked(tmp_path: Path) -> None:
    """The unit of positions and the baseline; everything else is in the file."""
    study = tmp_path / "study"
    shutil.copytree(CASES / "german_spreadsheet", study, ignore=shutil.ignore_patterns("study.yaml"))
    answers = iter(["inches", "cm", "Fusion"])
    questions = Questions(lambda _prompt: next(answers))
    text, _, study_made = proposed(study, Stated(), questions)
    assert questions.asked == ["In which unit are the positions in trials.csv?", "Which condition is the baseline?"]
    assert questions.taken == []
    assert study_made.conditions == ("Fusion", "Kinect")
    assert "Ziel X: target_x_cm" in text


def test_without_a_terminal_what_was_taken_is_said_with_its_option(tmp_path: Path, new: New) -> None:
    study = tmp_path / "study"
    shutil.copytree(CASES / "german_spreadsheet", study, ignore=shutil.ignore_patterns("study.yaml"))
    out = new(study).out
    assert "Taken for granted: In which unit are the positions in trials.csv? mm (--unit to say otherwise)" in out
    assert "Taken for granted: Which condition is the baseline? Kinect (--conditions to say otherwise)" in out


def test_files_that_are_not_used_are_named(tmp_path: Path, new: New) -> None:
    study = tmp_path / "study"
    shutil.copytree(CASES / "wide", study, ignore=shutil.ignore_patterns("study.yaml"))
    written(study, "zzz.csv", "participant,condition,clicks\n1,kinect,3\n1,fusion,4\n")
    written(study, "notes.csv", "day,weather\n1,rain\n")
    out = new(study).out
    assert "Not used: zzz.csv: measures.csv is read as the measures, and a study has one table" in out
    assert "Not used: notes.csv: no column is known to name the participants; it has day, weather" in out


def test_conditions_that_look_alike_are_refused(tmp_path: Path) -> None:
    study = written(tmp_path / "study", "m.csv", "participant,condition,time\n1,Kinect,3\n1,kinect,4\n2,fusion,4\n")
    with pytest.raises(PipelineError, match='the conditions "Kinect" and "kinect" look alike'):
        proposed(study, Stated(), Questions(None))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--column", "Code"), "should be a header and the column it means, such as --column Code=participant"),
        (("--unit", "inch"), '--unit: there is no "inch"'),
        (("--conditions", "kinect"), '--conditions: the data have "fusion" too'),
    ],
)
def test_options_that_cannot_be_understood_are_named(
    tmp_path: Path, new: New, words: tuple[str, ...], message: str
) -> None:
    study = tmp_path / "study"
    shutil.copytree(CASES / "wide", study, ignore=shutil.ignore_patterns("study.yaml"))
    ran = new(study, *words)
    assert ran.code == 2
    assert message in ran.err
    assert not (study / "study.yaml").exists()


def test_the_help_of_new_names_its_options(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    assert exit_code(monkeypatch, "new", "--help") == 0
    assert "--template" in capsys.readouterr().out

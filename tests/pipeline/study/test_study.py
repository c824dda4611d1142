"""study.yaml: what is understood, and what a user is told when it is not."""

from __future__ import annotations

import unicodedata
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.errors import PipelineError
from pipeline.study.folder import load_study
from pipeline.study.session_files import find_sessions
from tests.conftest import STREAMS
from tests.pipeline.helpers import Steadyhand

Folder = Callable[..., Path]
MINIMAL = """
title: T
conditions: [a, b]
measures: measures.csv
"""
MEASURES = "participant,condition,measure,value\nP1,a,m,1\nP1,b,m,2\nP2,a,m,2\nP2,b,m,1\n"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ("titel: T\nconditions: [a]\nmeasures: measures.csv\n", 'unknown key "titel"; did you mean "title"?'),
        ("measures: measures.csv\n", '"conditions" is missing'),
        ("conditions: [a, a]\nmeasures: measures.csv\n", 'conditions: "a" is listed twice'),
        ("conditions: [yes, b]\nmeasures: measures.csv\n", "is read as true/false; put it in quotes"),
        ("conditions: [a]\n", "has no data; add sessions, trials, questionnaires or measures"),
        ("conditions: [a]\nconditions: [b]\n", 'line 2: not valid YAML: "conditions" is given twice'),
        ("conditions: [a\n", "not valid YAML"),
        ("just a line\n", "holds no settings; it needs lines like"),
        (MINIMAL + "alpha: 5\n", '"alpha": input should be less than 1 (found 5)'),
        (MINIMAL + "data_origin: invented\n", "input should be 'recorded', 'simulated' or 'reconstructed'"),
        (MINIMAL + "comparisons: [{measure: m, test: anova}]\n", "comparisons.0.test"),
        (
            MINIMAL + "comparisons: [{measure: m, tset: wilcoxon}]\n",
            'unknown key "comparisons.0.tset"; did you mean "test"?',
        ),
        (MINIMAL + "exclusions: [{reason: gone}]\n", "needs a participant or a session to exclude"),
        (MINIMAL + "exclusions: [{participant: P1}]\n", '"exclusions.0.reason" is missing'),
        (MINIMAL + "shown: {c: x}\n", 'shown: "c" is not known'),
        ("conditions: [a]\nsessions: data/{subject}.mcap\n", 'placeholder "{subject}" is not known'),
        ("conditions: [a]\nsessions: data/log.mcap\n", "needs a placeholder"),
        (
            MINIMAL + "streams: {t: {topic: /t, kind: position, latncy_s: 1}}\n",
            'unknown key "streams.t.latncy_s"; did you mean "latency_s"?',
        ),
        (MINIMAL + "streams: {t: {topic: /t, kind: speed}}\n", '"streams.t" needs a kind: position, velocity'),
        (MINIMAL + "streams: {i: {topic: /i, kind: acceleration}}\n", '"streams.i.gravity_mm_s2" is missing'),
        (
            MINIMAL + STREAMS + "estimators: {e: {type: raw, use: [trakcer]}}\n",
            'estimators.e.use: "trakcer" is not known; did you mean "tracker"?',
        ),
    ],
)
def test_a_fault_in_the_settings_is_named_with_its_remedy(folder: Folder, settings: str, message: str) -> None:
    root = folder(settings, **{"measures.csv": MEASURES})
    with pytest.raises(PipelineError) as error:
        load_study(root)
    assert message in str(error.value)
    assert "study.yaml" in str(error.value)


@pytest.mark.parametrize("name", ["../measures.csv", "/etc/passwd", "a/../../measures.csv"])
def test_a_path_out_of_the_folder_is_refused(folder: Folder, name: str, steadyhand: Steadyhand) -> None:
    root = folder(MINIMAL.replace("measures.csv", name))
    ran = steadyhand("compare", root)
    assert ran.code == 2
    assert f'measures: "{name}" is outside the study folder' in ran.err


def test_a_link_out_of_the_folder_is_refused(folder: Folder, tmp_path: Path) -> None:
    (tmp_path / "secret.csv").write_text(MEASURES)
    root = folder(MINIMAL)
    (root / "measures.csv").symlink_to(tmp_path / "secret.csv")
    with pytest.raises(PipelineError, match="is outside the study folder"):
        load_study(root)


def test_no_study_yaml(tmp_path: Path, steadyhand: Steadyhand) -> None:
    ran = steadyhand("report", tmp_path)
    assert ran.code == 2
    assert f"{tmp_path}: holds no study.yaml" in ran.err
    ran = steadyhand("report", tmp_path / "nowhere")
    assert ran.code == 2
    assert "there is no such folder" in ran.err


@pytest.mark.parametrize(
    ("estimators", "message"),
    [
        ("{e: {type: windowgp}}", 'estimators.e: type "windowgp" is not known; did you mean "window_gp"?'),
        ("{e: {type: window_gp, windw: 3}}", 'estimators.e: unknown key "windw"; did you mean "window"?'),
        ("{e: {type: window_gp, window: many}}", 'estimators.e: "window": input should be a valid integer'),
        ("{e: {type: window_gp, window: -1}}", "estimators.e: window must be 1 or more"),
        ("{e: {type: window_gp, use: [imu]}}", "estimators.e: an estimator needs a position sensor, got imu"),
    ],
)
def test_a_fault_in_an_estimator_is_named(
    folder: Folder, steadyhand: Steadyhand, estimators: str, message: str
) -> None:
    from tests.conftest import write_session

    root = folder(
        "conditions: [a]\nsessions: '{participant}_{condition}.mcap'\n" + STREAMS + f"estimators: {estimators}\n"
    )
    write_session(root / "P1_a.mcap")
    ran = steadyhand("compare", root)
    assert ran.code == 2
    assert message in ran.err


def test_sessions_are_found_by_pattern_and_ids_compared_after_nfc(folder: Folder) -> None:
    root = folder("conditions: [café]\nsessions: data/{participant}_{condition}.mcap\n" + STREAMS)
    (root / "data").mkdir()
    for name in (unicodedata.normalize("NFD", "P1_café"), "P2_other", "notes", "P_1_2"):
        (root / "data" / f"{name}.mcap").touch()
    study = load_study(root)
    found = find_sessions(root, study)
    sessions = found.sessions
    assert [name for name, _ in found.unused] == ["data/P_1_2.mcap", "data/notes.mcap"]
    assert [(session.id, session.condition) for session in sessions] == [
        ("P1_café", "café"),
        ("P2_other", "other"),
    ]
    assert sessions[0].condition in study.conditions


def test_two_equal_ids_are_an_error(folder: Folder) -> None:
    """The same name in two ways to write "é" in Unicode."""
    root = folder("conditions: [a]\nsessions: '{participant}_{condition}.mcap'\n" + STREAMS)
    for form in ("NFC", "NFD"):
        (root / f"{unicodedata.normalize(form, 'Zoé')}_a.mcap").touch()
    with pytest.raises(PipelineError, match='are both session "Zoé_a"'):
        find_sessions(root, load_study(root))


@pytest.mark.parametrize(
    ("pattern", "files", "expected"),
    [
        ("{condition}/{participant}.mcap", ["a/P1.mcap", "a/P2.mcap"], {"a_P1": ["P1.mcap"], "a_P2": ["P2.mcap"]}),
        (
            "data/{participant}_{condition}",
            ["data/P1_a/metadata.yaml", "data/P1_a/P1_a_0.mcap", "data/P1_a/.hidden"],
            {"P1_a": ["P1_a_0.mcap", "metadata.yaml"]},
        ),
        (
            "{participant}/{participant}_{condition}_*.mcap",
            ["P1/P1_a_0.mcap", "P1/P1_a_1.mcap", "P1/P2_a_0.mcap"],
            {"P1_a": ["P1_a_0.mcap", "P1_a_1.mcap"]},
        ),
        (
            "{participant}_{condition}/*.mcap",
            ["P1_a/b.mcap", "P1_a/c.mcap", "P2_a/b.mcap", "P2_a/notes.txt"],
            {"P1_a": ["b.mcap", "c.mcap"], "P2_a": ["b.mcap"]},
        ),
        (
            "{participant}_{condition}/Accelerometer.csv",
            ["P1_a/Accelerometer.csv", "P1_a/tracker.csv", "P1_a/notes.txt"],
            {"P1_a": ["Accelerometer.csv", "tracker.csv"]},
        ),
        ("{participant}_{condition}.mcap.zstd", ["P1_a.mcap.zstd"], {"P1_a": ["P1_a.mcap.zstd"]}),
    ],
)
def test_sessions_of_several_files(
    folder: Folder, pattern: str, files: list[str], expected: dict[str, list[str]]
) -> None:
    root = folder(f"conditions: [a]\nsessions: '{pattern}'\n" + STREAMS)
    for name in files:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).touch()
    sessions = find_sessions(root, load_study(root)).sessions
    assert {session.id: [file.name for file in session.files] for session in sessions} == expected
    assert all((session.participant or "").startswith("P") and session.condition == "a" for session in sessions)


def test_folders_that_cannot_be_sessions_are_named(folder: Folder) -> None:
    root = folder("conditions: [a]\nsessions: 'data/{participant}_{condition}'\n" + STREAMS)
    for name in ("P1_a", "P2-a", "P3_a"):
        (root / "data" / name).mkdir(parents=True)
    (root / "data" / "P2-a" / "x.mcap").touch()
    (root / "data" / "P1_a" / "x.mcap").touch()
    (root / "data" / "P4_a").touch()
    found = find_sessions(root, load_study(root))
    assert [session.id for session in found.sessions] == ["P1_a"]
    assert found.unused == [("data/P2-a", "its name does not fit the pattern of study.yaml")]
    assert [(session.id, reason.split(",")[0]) for session, reason in found.set_aside] == [
        ("data/P3_a", "the folder holds no file"),
        ("data/P4_a", "it is a file"),
    ]


def test_a_star_stands_in_the_name_of_the_file_only(folder: Folder, steadyhand: Steadyhand) -> None:
    ran = steadyhand("compare", folder("conditions: [a]\nsessions: '*/{participant}_{condition}.mcap'\n" + STREAMS))
    assert '"*" may stand only in the name of the file' in ran.err


def test_a_minimal_study_needs_no_title(folder: Folder) -> None:
    root = folder("conditions: [1, 2]\nmeasures: measures.csv\n", name="pilot", **{"measures.csv": MEASURES})
    study = load_study(root)
    assert study.title == "pilot"
    assert study.conditions == ("1", "2")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("streams: {i: {topic: /i, kind: acceleration, gravity_mm_s2: [0, .nan, 0]}}", "streams.i.gravity_mm_s2.1"),
        ("streams: {r: {topic: /r, kind: reference, rotation_xyzw: [0, 0, 0, 0]}}", "rotation_xyzw is all zeros"),
        ("streams: {t: {topic: /t, kind: position, latency_s: 1e9}}", "streams.t.latency_s"),
        (
            "streams: {r: {topic: /r, kind: reference}, s: {topic: /s, kind: reference}}",
            "r and s are both of kind reference; keep one",
        ),
        ("notes: &a x\ncitation: *a", "aliases (*name) are not understood"),
        ('measures: "a\\0b.csv"', "cannot be a path"),
    ],
)
def test_settings_that_cannot_be_are_named(folder: Folder, steadyhand: Steadyhand, line: str, message: str) -> None:
    settings = MINIMAL if not line.startswith("measures") else MINIMAL.replace("measures: measures.csv\n", "")
    ran = steadyhand("compare", folder(settings + line + "\n", **{"measures.csv": MEASURES}))
    assert ran.code == 2
    assert message in ran.err


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("test: tost", "tost needs bounds, in the unit of the measure, such as bounds: [-5, 5]"),
        ("test: tost, bounds: [5, -5]", "bounds need the lower one first, found [5.0, -5.0]"),
        ("test: t_paired, bounds: [-5, 5]", "t_paired does not take bounds; it is for tost"),
        (
            "test: friedman, within: [condition, task]",
            "friedman does not take within; it is for rm_anova, art_anova",
        ),
        ("test: rm_anova, within: [task]", 'within of "m" must contain "condition", and no name twice'),
        (
            "test: mixed_model, fixed: [condition, period, factor(period)]",
            'fixed of "m" must contain "condition", and no name',
        ),
        (
            "test: mixed_model, fixed: [condition, 'condition:task']",
            'fixed: "condition:task" needs "task" as a term too',
        ),
        (
            "test: mixed_model, fixed: [condition, period, 'condition:period']",
            'fixed: "condition:period" needs factor(period) in the place of period',
        ),
        ("test: bayes_t, prior_scale: 0", "prior_scale"),
        ("test: mixed_model, fixed: [condition, task]", '"m" has no factor "task"'),
        (
            "test: mixed_model, fixed: [condition, period]",
            "needs the period, but no data state it; give a column",
        ),
        ("test: crossover", 'crossover of "m" needs the period'),
        (
            "test: mixed_model, fixed: [condition, hand]",
            '"hand" of "m" has one level in the rows of the model; take it',
        ),
        ("test: anova", "comparisons.0.test"),
    ],
)
def test_a_comparison_that_cannot_be_is_named(folder: Folder, steadyhand: Steadyhand, entry: str, message: str) -> None:
    settings = f"conditions: [a, b]\nmeasures: measures.csv\ncomparisons: [{{measure: m, {entry}}}]\n"
    rows = "".join(f"P{person},{condition},m,{person},left\n" for person in (1, 2, 3) for condition in "ab")
    table = f"participant,condition,measure,value,hand\n{rows}"
    ran = steadyhand("compare", folder(settings, **{"measures.csv": table}))
    assert ran.code == 2
    assert message in ran.err


def test_a_crossover_is_of_two_conditions(folder: Folder, steadyhand: Steadyhand) -> None:
    settings = "conditions: [a, b, c]\nmeasures: measures.csv\ncomparisons: [{measure: m, test: crossover}]\n"
    ran = steadyhand("compare", folder(settings, **{"measures.csv": "participant,condition,measure,value\nP1,a,m,1\n"}))
    assert ran.code == 2
    assert "crossover is for two conditions, and there are 3; mixed_model with fixed: [condition, period]" in ran.err

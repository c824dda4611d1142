"""`pipeline.load`: a study's tables in Python are those of the command."""

from __future__ import annotations

import json
import pickle
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

import pipeline
from pipeline.errors import PipelineError
from pipeline.notebook import STAGE_OF, Tables
from pipeline.tables import table as stored
from pipeline.tables.catalogue import IN_STUDY_RESULTS, TABLES
from tests.conftest import CLONE, STREAMS, session_messages, write_session
from tests.pipeline.helpers import Steadyhand

Folder = Callable[..., Path]
SETTINGS = """
conditions: [a, b]
sessions: '{participant}_{condition}.mcap'
estimators: {raw: {type: raw}}
comparisons: [{measure: trial_time_s, test: t_paired}]
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a study, and a cache that holds all of it."""
    root = tmp_path_factory.mktemp("made")
    for index, name in enumerate(("P1_a", "P1_b", "P2_a", "P2_b")):
        write_session(root / "study" / f"{name}.mcap", session_messages(3.6, seed=index))
    (root / "study" / "study.yaml").write_text(SETTINGS + STREAMS)
    pipeline.load(root / "study", cache=root / "cache")
    return root


@pytest.fixture
def study(made: Path, tmp_path: Path) -> Path:
    """A copy to be changed, with the cache beside it."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    return tmp_path / "study"


@pytest.fixture
def loaded(made: Path) -> Tables:
    return pipeline.load(made / "study", cache=made / "cache")


def test_importing_it_imports_no_heavy_library() -> None:
    code = "import sys, pipeline; print(sorted({'numpy', 'pandas', 'pydantic', 'pyarrow', 'typer'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=CLONE)
    assert done.stdout == "[]\n"


def test_the_tables_are_those_of_the_command_and_of_its_cache(study: Path, steadyhand: Steadyhand) -> None:
    assert "Nothing had changed" in steadyhand("compare", study).out
    kept = {path.name for path in steadyhand.cache.rglob("??/*")}
    tables = pipeline.load(str(study), cache=str(steadyhand.cache))
    assert {path.name for path in steadyhand.cache.rglob("??/*")} == kept
    found = steadyhand.results()
    for name in IN_STUDY_RESULTS:
        rows = list(stored.records(name, tables[name]))
        for row in rows:
            if "details" in row and row["details"] is not None:
                row["details"] = json.loads(row["details"])
        assert rows == found[name]
    assert len(tables.comparisons) == 1
    assert tables.study.conditions == ("a", "b")


def test_every_table_of_a_study_is_there(loaded: Tables) -> None:
    never_stored = {"sequences"}
    of_other_commands = {name for name in TABLES if name.startswith(("replay_", "explore"))} - {"replay_agreement"}
    assert set(STAGE_OF) == set(TABLES) - never_stored - of_other_commands
    assert list(loaded) == list(STAGE_OF)
    assert len(loaded) == len(STAGE_OF)
    assert set(STAGE_OF) <= set(dir(loaded))
    for name, table in loaded.items():
        assert list(table.columns) == TABLES[name].names
    filled = {name for name, table in loaded.items() if len(table)}
    assert filled >= {
        "positions",
        "imu",
        "events",
        "tracks",
        "trials",
        "measures",
        "accuracy",
        "quality",
        "observations",
    }


def test_tables_are_read_when_asked_for(loaded: Tables, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []
    reading = stored.read

    def noted(name: str, folders: Path | list[Path]) -> pd.DataFrame:
        read.append(name)
        return reading(name, folders)

    monkeypatch.setattr(stored, "read", noted)
    assert "tables of 4 sessions" in repr(loaded)
    assert read == []
    assert loaded.measures is loaded["measures"]
    assert loaded.tracks is not loaded.tracks
    assert read == ["measures", "tracks", "tracks"]


def test_a_session_by_itself(loaded: Tables) -> None:
    one = loaded.in_session("P2_a")
    for name in one:
        whole = loaded[name]
        pd.testing.assert_frame_equal(one[name], whole[whole["session"] == "P2_a"].reset_index(drop=True))
    assert len(one.tracks) * 4 == len(loaded.tracks)
    assert "comparisons" not in one
    assert [session.id for session in one.sessions] == ["P2_a"]
    with pytest.raises(KeyError, match='there is no session "P2a"; did you mean "P2_'):
        loaded.in_session("P2a")


def test_participant_means_are_in_the_order_of_the_study(loaded: Tables) -> None:
    wide = loaded.participant_means("trial_time_s")
    assert list(wide.columns) == ["a", "b"]
    assert list(wide.index) == ["P1", "P2"]
    with pytest.raises(KeyError, match='there is no measure "trial_time"; did you mean "trial_time_s"'):
        loaded.participant_means("trial_time")


def test_a_name_that_is_none_is_answered_with_the_one_that_was_meant(loaded: Tables) -> None:
    with pytest.raises(AttributeError, match='there is no table "comparison"; did you mean "comparisons"'):
        _ = loaded.comparison
    with pytest.raises(KeyError, match="did you mean"):
        _ = loaded["comparison"]
    assert not hasattr(loaded, "_repr_mimebundle_")
    assert loaded.get("nothing") is None


def test_tables_can_be_pickled(loaded: Tables) -> None:
    again = pickle.loads(pickle.dumps(loaded))  # noqa: S301 - our own
    pd.testing.assert_frame_equal(again.measures, loaded.measures)


def test_what_befell_a_session_is_a_warning(study: Path, tmp_path: Path) -> None:
    (study / "P3_a.mcap").write_bytes(b"not a log")
    with pytest.warns(UserWarning, match="study: session P3_a set aside: "):
        tables = pipeline.load(study, cache=tmp_path / "cache")
    assert [session.id for session in tables.sessions] == ["P1_a", "P1_b", "P2_a", "P2_b"]
    assert set(tables.positions["session"]) == {"P1_a", "P1_b", "P2_a", "P2_b"}
    assert "P3_a" in set(tables.exclusions["session"])


def test_a_study_that_cannot_be_loaded(folder: Folder, tmp_path: Path) -> None:
    with pytest.raises(PipelineError, match="condition"):
        pipeline.load(folder("condition: [a]\n"), cache=tmp_path / "cache")
    with pytest.raises(PipelineError, match='there is no "abacus"'):
        pipeline.load(tmp_path, executor="abacus")


def test_a_table_that_has_gone_from_the_cache_is_no_empty_one(study: Path, tmp_path: Path) -> None:
    loaded = pipeline.load(study, cache=tmp_path / "cache")
    shutil.rmtree(tmp_path / "cache" / "fuse")
    with pytest.raises(PipelineError, match="has gone from the cache since the study was loaded; load it again"):
        _ = loaded.tracks
    assert len(loaded.measures)


def test_several_jobs_in_a_script_say_what_they_need(folder: Folder, tmp_path: Path) -> None:
    """A process that is started runs the script anew, as far as that is not guarded."""
    root = folder(SETTINGS.replace("estimators: {raw: {type: raw}}\n", "") + STREAMS)
    write_session(root / "P1_a.mcap", session_messages(2.0))
    line = f"print(len(pipeline.load({str(root)!r}, cache={str(tmp_path / 'cache')!r}, jobs=2).positions))"
    script = tmp_path / "script.py"
    script.write_text(f"import pipeline\n{line}\n")
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False, cwd=CLONE)
    assert done.returncode
    assert "put it under: if __name__ == '__main__'" in done.stderr
    script.write_text(f"import pipeline\nif __name__ == '__main__':\n    {line}\n")
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False, cwd=CLONE)
    assert int(done.stdout) > 0

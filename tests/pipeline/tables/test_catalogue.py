"""The tables' records: complete, true to what stages write, and the contract of results.json and the CSV files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.stages import STAGES
from pipeline.tables.catalogue import AS_CSV, CHECKED, GATHERED, IN_STUDY_RESULTS, TABLES, in_results_of, written_by
from pipeline.tables.columns import TEXT, Table
from pipeline.tables.command_tables import EXPLORE_TABLES, REPLAY_TABLES
from pipeline.tables.page import PAGE, page
from pipeline.tables.session_tables import SESSION_TABLES
from pipeline.tables.study_tables import STUDY_TABLES
from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.helpers import Steadyhand

Folder = Callable[..., Path]
EVERY = (*SESSION_TABLES, *STUDY_TABLES, *REPLAY_TABLES, *EXPLORE_TABLES)
OF_SOME_STUDIES = {"readings", "recorders", "session_orders", "printed", "simulated_reductions"}
SETTINGS = """
conditions: [a, b]
sessions: '{participant}_{condition}.mcap'
estimators: {raw: {type: raw}}
comparisons: [{measure: trial_time_s, test: t_paired}]
"""


def test_no_two_tables_share_a_name() -> None:
    assert len(TABLES) == len(EVERY)


@pytest.mark.parametrize("table", EVERY, ids=lambda table: table.name)
def test_a_record_is_complete(table: Table) -> None:
    assert table.about.startswith(("One row per ", "The same ")), table.about
    assert table.about.endswith(".")
    assert len(set(table.names)) == len(table.names)
    for column in table.columns:
        assert column.about.strip(), column.name
        assert not column.about.endswith("."), column
        assert not set("|<>") & set(column.about.replace("[window=3]", "")), column
    kinds = {column.name: column.kind for column in table.columns}
    assert all(kinds[name] == TEXT for name in table.key)
    compared = table.in_results and table not in EXPLORE_TABLES  # `diff` compares no explorations
    assert bool(table.key) == compared


def test_the_lists_of_results_json_and_their_order_are_a_contract() -> None:
    assert IN_STUDY_RESULTS == (
        "descriptives",
        "intervals_within",
        "differences",
        "comparisons",
        "comparisons_all_data",
        "accuracy",
        "replay_agreement",
        "quality",
        "checks",
        "exclusions",
        "sensor_noise",
        "phones",
        "shown_at_selection",
        "accuracy_means",
        "printed",
        "design_check",
        "simulated_reductions",
        "reliability",
        "preregistration",
        "learning",
        "fitts",
        "fitts_points",
        "descriptives_by_group",
        "sensors_found",
        "recorders",
    )
    assert in_results_of("replay") == ["accuracy", "replay_means", "replay_exclusions"]
    assert written_by("replay") == ["accuracy", "replay_trials", "replay_means", "replay_exclusions"]
    assert written_by("explore") == in_results_of("explore") == ["explore", "explore_differences", "explore_people"]
    assert CHECKED == ("descriptives", "comparisons", "accuracy", "replay_agreement")


def test_the_csv_files_are_what_the_report_says_and_the_trials_and_movements_behind_it() -> None:
    behind = {"selections", "movements", "trials", "measures", "calibration", "group_members", "normal_quantiles"}
    assert set(AS_CSV) == {*IN_STUDY_RESULTS, *behind}


def test_each_stage_writes_the_tables_that_name_it(folder: Folder, steadyhand: Steadyhand) -> None:
    study = folder(SETTINGS + STREAMS)
    for index, name in enumerate(("P1_a", "P1_b", "P2_a", "P2_b")):
        write_session(study / f"{name}.mcap", session_messages(3.6, seed=index))
    assert steadyhand("compare", study).code == 0
    names = [stage.name for stage in STAGES]
    for stage in names[:-1]:
        stored = {path.stem for path in (steadyhand.cache / stage).glob("*/*/*.parquet")}
        declared = {table.name for table in EVERY if stage in table.stages}
        assert declared - OF_SOME_STUDIES <= stored <= declared
    for table in EVERY:
        assert sorted(table.stages, key=names.index) == list(table.stages)


def test_what_is_gathered_from_sessions_is_named_by_its_session() -> None:
    for name, stage in GATHERED.items():
        assert "session" in TABLES[name].names
        assert {one.name: one.scope for one in STAGES}[stage] == "session"


def test_the_page_of_tables_is_up_to_date() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "docs/tables.md: run make docs"


def test_the_page_names_every_table_and_column() -> None:
    text = page()
    for table in EVERY:
        part = text.split(f"### {table.name}\n", 1)[1].split("\n### ", 1)[0]
        for column in table.columns:
            assert f"| `{column.name}` |" in part

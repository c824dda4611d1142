"""All tables by name, and the lists of tables that derive from their records."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.tables.columns import Table
from pipeline.tables.command_tables import EXPLORE_TABLES, REPLAY_TABLES
from pipeline.tables.session_tables import SESSION_TABLES
from pipeline.tables.study_tables import STUDY_TABLES

TABLES: Mapping[str, Table] = {
    table.name: table for table in (*SESSION_TABLES, *STUDY_TABLES, *REPLAY_TABLES, *EXPLORE_TABLES)
}
"""All tables. Columns never vary with data or options; what does not apply is null."""


def written_by(command: str) -> list[str]:
    """The tables that a command, replay or explore, writes with its report."""
    return [table.name for table in TABLES.values() if command in table.commands]


def in_results_of(command: str) -> list[str]:
    """Those of its tables whose rows are in the command's results.json."""
    return [name for name in written_by(command) if TABLES[name].in_results]


IN_STUDY_RESULTS = tuple(table.name for table in TABLES.values() if table.stages and table.in_results)
"""The lists of a study's results.json, in its order."""

CHECKED = tuple(table.name for table in TABLES.values() if table.checked)
"""The tables whose numbers `steadyhand check` expects to stay the same."""

AS_CSV = tuple(table.name for table in TABLES.values() if table.stages and table.as_csv)
"""The CSV files in the folder `tables` of a study's report."""

GATHERED: Mapping[str, str] = {
    table.name: table.stages[0]
    for table in TABLES.values()
    if len(table.stages) == 2 and table.stages[0] in ("ingest", "assess") and table.stages[1] == "compare"
}
"""The tables that the stage compare only gathers from the sessions, each with the stage that writes it."""

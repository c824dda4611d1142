"""The stages in order. Each names all that may change its output; nothing else reaches it."""

from __future__ import annotations

from pipeline.engine.stage import Stage
from pipeline.study.folder import PREREGISTERED
from pipeline.study.settings import Study

TABLES_AS_GIVEN = ("format", "columns", "missing")
"""How the study's own tables are written; for a stage that reads one."""

STAGES: tuple[Stage, ...] = (
    Stage(
        "ingest",
        "session",
        "pipeline.sessions.ingest:run",
        settings=("streams", "events", "log_limits", "conditions", "task"),
        reads_log=True,
        label="reading logs",
    ),
    Stage(
        "fuse",
        "session",
        "pipeline.sessions.fuse:run",
        reads=("ingest",),
        settings=("streams", "estimators", "axes"),
        label="fusing",
    ),
    Stage(
        "assess",
        "session",
        "pipeline.sessions.assess:run",
        reads=("ingest", "fuse"),
        settings=("streams", "estimators", "axes", "shown", "task"),
        label="assessing sessions",
    ),
    Stage(
        "measure",
        "study",
        "pipeline.analysis.measure:run",
        reads=("ingest", "assess"),
        settings=(
            "conditions",
            "display",
            "exclusions",
            *TABLES_AS_GIVEN,
            "wide",
            "practice",
            "scoring",
            "factors",
            "participants",
            "trials",
            "questionnaires",
            "measures",
            "task",
        ),
        files=("participants", "trials", "questionnaires", "measures"),
        label="measuring",
    ),
    Stage(
        "compare",
        "study",
        "pipeline.analysis.compare:run",
        reads=("ingest", "assess", "measure"),
        settings=(
            "title",
            "data_origin",
            "conditions",
            "comparisons",
            "question",
            "factors",
            "alpha",
            "exclusions",
            *TABLES_AS_GIVEN,
            "participants",
            "printed",
            "streams",
            "axes",
            "estimators",
            "simulation",
            "repeats",
            "scoring",
            "shown",
            "preregistration",
        ),
        files=("participants", "printed", "repeats"),
        fixed_files=(PREREGISTERED,),
        label="comparing",
    ),
    Stage(
        "report",
        "study",
        "pipeline.report.write:run",
        reads=("ingest", "fuse", "assess", "measure", "compare"),
        settings=tuple(Study.model_fields),
        names_inputs=True,
        label="writing the report",
    ),
)

INGEST = STAGES[:1]
"""What reads logs and goes no further."""

COMPARE = STAGES[:-1]
"""What `steadyhand compare` runs: everything but figures and pages."""

REPLAY = Stage(
    "replay",
    "session",
    "pipeline.sessions.replay:run",
    reads=("ingest",),
    settings=("streams", "estimators", "axes"),
    label="replaying",
    unit="sessions by variants",
)
"""What `steadyhand replay` runs for each session and variant, by a study that holds the one estimator alone."""

MODULES_OF_SESSIONS = (
    *(stage.module for stage in (*STAGES, REPLAY) if stage.scope == "session"),
    "scipy.signal",  # imported where there are movements: two thirds of a second
)
"""What a process imports that computes sessions."""

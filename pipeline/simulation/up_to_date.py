"""Whether a simulated study's files exist and are up to date. Every run checks this, so nothing heavy is imported."""

from __future__ import annotations

import json
from pathlib import Path

from pipeline.engine.cache import digest_of
from pipeline.engine.code_digest import code_digest
from pipeline.study.settings import Study

MADE = "simulated.json"
"""The file beside study.yaml that lists what the last simulation wrote, and a digest of what it depended on."""


def files_made(folder: Path) -> list[str]:
    """The files of the last simulation that finished; none if there was none."""
    try:
        return [str(name) for name in json.loads((folder / MADE).read_text(encoding="utf-8"))["files"]]
    except (OSError, ValueError, KeyError, TypeError):
        return []


def is_made(folder: Path, study: Study) -> bool:
    """Whether the files exist and were made from these settings by this code."""
    try:
        made = json.loads((folder / MADE).read_text(encoding="utf-8"))
        there = all((folder / name).is_file() for name in made["files"])
        return bool(there and made["from"] == made_from(study))
    except (OSError, ValueError, KeyError, TypeError):
        return False


def made_from(study: Study) -> str:
    """A digest of everything that the files depend on: settings and code."""
    settings = {"conditions", "sessions", "axes", "streams", "events", "estimators", "shown", "task", "simulation"}
    tables = {"participants", "questionnaires", "repeats"}
    return digest_of(
        [json.loads(study.model_dump_json(include=settings | tables)), code_digest("pipeline.simulation.study_files")]
    )

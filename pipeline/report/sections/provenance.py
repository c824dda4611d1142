"""What the report was made from, and with what."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from pipeline.engine.code_digest import versions
from pipeline.engine.provenance import LIBRARIES
from pipeline.report.document.model import Column, Folded, Paragraph, Section, Table, columns
from pipeline.report.prose.methods import computed_with
from pipeline.report.sections.material import Material
from pipeline.sessions.estimators import build_estimator
from pipeline.statistics import WILSON
from pipeline.study.statistical_tests import TESTS
from pipeline.words.estimators import estimator_in_words, settings_in_words
from pipeline.words.numbers import NO_VALUE
from pipeline.words.phrases import counted, listing

_FILES_MAX = 60


def used_versions(statistics: Iterable[str] = ()) -> dict[str, str]:
    """What makes reports, and in which version, with the libraries that computed statistics of this one."""
    return {"Python": platform.python_version(), **versions(["steadyhand", *LIBRARIES, *statistics])}


def statistics_libraries(results: Mapping[str, Any]) -> set[str]:
    """The libraries that computed part of a study's statistics, beside those that every report needs."""
    used = {name for row in results["comparisons"] for name in TESTS[row["test"]].libraries}
    adjusted = any(row["p_adjusted"] is not None for row in results["comparisons"])
    if adjusted or any(row["interval"] == WILSON for row in results["descriptives"]):
        used.add("statsmodels")
    if any(row["alpha"] is not None for row in results["reliability"]):
        used.add("pingouin")
    return used


def program() -> Paragraph:
    """What made the report, in which version."""
    return Paragraph((computed_with(used_versions()),))


def section(material: Material) -> Section:
    """Provenance."""
    text = (
        f"Made by Steadyhand from the study folder “{material.name}”, {counted(len(material.inputs), 'file')}. Every"
        " number in this report is in results.json and in the tables folder beside it; provenance.json holds the"
        " settings, the command and the version of every library."
    )
    return Section(
        "provenance",
        "Provenance",
        (
            Paragraph((text,)),
            *_settings(material),
            Folded("Digests of the files that were read", (_inputs(material),), in_annex=False),
        ),
    )


def _settings(material: Material) -> Iterator[Folded]:
    """Every estimator's settings, those that study.yaml leaves to the program too."""
    study = material.study
    if not study.estimators or study.sessions is None:
        return
    rows = []
    for name, settings in study.estimators.items():
        streams = [f"streams {listing(list(settings.use))}"] if settings.use else []
        words = settings_in_words(build_estimator(study, name))
        rows.append((name, estimator_in_words(settings.type), ", ".join([*streams, *words.values()]) or NO_VALUE))
    table = Table(
        "table-estimators",
        "The estimators with all their settings: those of study.yaml, and the defaults of this version for the others.",
        columns(("Estimator", "What it is", "Settings"), 3),
        tuple(rows),
        cards=True,
    )
    yield Folded("The settings of the estimators", (table,), in_annex=False)


def _inputs(material: Material) -> Table:
    listed = sorted(material.inputs.items())[:_FILES_MAX]
    more = f" The first {_FILES_MAX} of {len(material.inputs)}." if len(material.inputs) > _FILES_MAX else ""
    return Table(
        "table-inputs",
        f"Files that were read, with the first digits of their SHA-256 (equal files, equal digests).{more}",
        (Column("File", False), Column("SHA-256", False)),
        tuple((name, digest[:16]) for name, digest in listed),
    )

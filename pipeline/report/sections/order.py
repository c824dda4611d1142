"""The order of the report's sections.

Each is a function from a study's tables to a Section, or to None where it has nothing to show.
"""

from __future__ import annotations

from collections.abc import Callable

from pipeline.report.document.model import Section
from pipeline.report.sections import (
    accuracy,
    comparisons,
    design,
    fitts_law,
    outcomes,
    overview,
    participants,
    paste,
    paths,
    practice,
    preregistration,
    printed,
    provenance,
    quality,
    simulation,
)
from pipeline.report.sections.material import Material

SECTIONS: tuple[Callable[[Material], Section | None], ...] = (
    overview.section,
    design.section,
    preregistration.section,
    quality.section,
    accuracy.section,
    paths.section,
    outcomes.selection,
    outcomes.time,
    practice.section,
    fitts_law.section,
    outcomes.workload,
    outcomes.others,
    comparisons.section,
    simulation.section,
    paste.section,
    printed.section,
    participants.section,
    provenance.section,
)

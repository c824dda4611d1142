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


def _paste_after_people(material: Material) -> Section | None:
    return paste.section(material) if material.rows("comparisons") else None


def _paste_after_accuracy(material: Material) -> Section | None:
    """Where nothing was compared, accuracy is the result, and comes first."""
    return None if material.rows("comparisons") else paste.section(material)


SECTIONS: tuple[Callable[[Material], Section | None], ...] = (
    # The answer, and the results it rests on.
    overview.section,
    outcomes.selection,
    outcomes.time,
    outcomes.workload,
    outcomes.others,
    practice.section,
    fitts_law.section,
    comparisons.section,
    _paste_after_people,
    # How they came about: who met what when, what was planned, and how well the hand was followed.
    design.section,
    preregistration.section,
    accuracy.section,
    paths.section,
    _paste_after_accuracy,
    simulation.section,
    printed.section,
    # What most readers pass over, unless something is wrong.
    quality.section,
    participants.section,
    provenance.section,
)

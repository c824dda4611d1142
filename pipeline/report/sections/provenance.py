"""What the report was made from, and with what."""

from __future__ import annotations

import platform

from pipeline.engine.code_digest import versions
from pipeline.engine.provenance import LIBRARIES
from pipeline.report.document.model import Column, Paragraph, Section, Table
from pipeline.report.sections.material import Material
from pipeline.words.phrases import counted

_FILES_MAX = 60


def used_versions() -> dict[str, str]:
    """What makes reports, and in which version."""
    return {"Python": platform.python_version(), **versions(["steadyhand", *LIBRARIES])}


def libraries() -> Table:
    """What made the report, in which version."""
    titles = (Column("Name", False), Column("Version", False))
    return Table("table-versions", "Program and libraries.", titles, tuple(used_versions().items()))


def section(material: Material) -> Section:
    """Provenance."""
    text = (
        f"Made by Steadyhand from the study folder “{material.name}”, {counted(len(material.inputs), 'file')}. Every"
        " number in this report is in results.json and in the tables folder beside it; provenance.json holds the"
        " settings and the command."
    )
    listed = sorted(material.inputs.items())[:_FILES_MAX]
    more = f" The first {_FILES_MAX} of {len(material.inputs)}." if len(material.inputs) > _FILES_MAX else ""
    return Section(
        "provenance",
        "Provenance",
        (
            Paragraph((text,)),
            libraries(),
            Table(
                "table-inputs",
                f"Files that were read, with the first digits of their SHA-256 (equal files, equal digests).{more}",
                (Column("File", False), Column("SHA-256", False)),
                tuple((name, digest[:16]) for name, digest in listed),
            ),
        ),
    )

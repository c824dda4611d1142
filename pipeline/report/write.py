"""The report: sections from tables, one document, two renderings, tables as CSV, figures as SVG, references."""

from __future__ import annotations

from pipeline.engine.jobs import Jobs
from pipeline.engine.stage import Outcome, Work
from pipeline.report.document import html, pdf
from pipeline.report.document.model import Document
from pipeline.report.own_pictures import own_pictures
from pipeline.report.sections import glossary, participants, paste, traces
from pipeline.report.sections.material import ORIGINS, Material
from pipeline.report.sections.order import SECTIONS
from pipeline.tables import results
from pipeline.tables import table as tables
from pipeline.tables.catalogue import AS_CSV

_MANY = 8  # sessions: with fewer all figures are drawn before another process is ready


def run(work: Work) -> Outcome:
    """report.html, traces.html, participants/*.html, report.pdf, references.bib, tables/*.csv and figures/*.svg."""
    for folder in ("tables", "figures"):
        (work.out / folder).mkdir()
    with Jobs(work.executor if len(work.sessions) >= _MANY else None) as jobs:
        material = _material(work, jobs)
        sections = tuple(section for make in SECTIONS if (section := make(material)) is not None)
        sections += glossary.of(sections)
        # The rest is done here meanwhile: other processes would have to be sent most of the tables for it.
        for name in AS_CSV:
            tables.write_csv(name, material.table(name), work.out / "tables")
        traces.write(material, work.out / traces.PAGE)
        participants.write(material, work.out / participants.FOLDER)
        (work.out / paste.BIBLIOGRAPHY).write_text(paste.bibtex(material), encoding="utf-8")
    # Both renderings hold the figures, which are all drawn now.
    subtitle = f"Study “{work.study_name}”"
    document = Document(work.study.title, subtitle, ORIGINS[work.study.data_origin], sections)
    html.render(document, work.out / "figures", work.out / "report.html")
    pdf.render(document, work.out / "figures", work.out / "report.pdf")
    return Outcome()


def _material(work: Work, jobs: Jobs) -> Material:
    return Material(
        work.study_name,
        work.study,
        results.read(work.entry("compare") / "results.json"),
        work.sessions,
        work.entries,
        work.out / "figures",
        work.inputs,
        jobs,
        own_pictures(work),
    )

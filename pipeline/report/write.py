"""The report: sections from tables, one document, two renderings, tables as CSV, figures as SVG, references."""

from __future__ import annotations

from concurrent.futures import Executor

from pipeline.engine.stage import Outcome, Work
from pipeline.engine.two_processes import Job, another_process, carry_out
from pipeline.report.document import html, pdf
from pipeline.report.document.model import Document
from pipeline.report.sections import SECTIONS, glossary, participants, paste, traces
from pipeline.report.sections.material import ORIGINS, Material
from pipeline.tables import results
from pipeline.tables import table as tables
from pipeline.tables.catalogue import AS_CSV

_MANY = 8  # sessions: with fewer all is drawn before another process is ready


def run(work: Work) -> Outcome:
    """The report's files; those of a study with many sessions are drawn in two processes."""
    with another_process(len(work.sessions) >= _MANY, "pipeline.report.sections") as pool:
        _write(work, pool)
    return Outcome()


def _write(work: Work, pool: Executor | None) -> None:
    """report.html, traces.html, participants/*.html, report.pdf, references.bib, tables/*.csv and figures/*.svg."""
    for folder in ("tables", "figures"):
        (work.out / folder).mkdir()
    material = Material(
        work.study_name,
        work.study,
        results.read(work.entry("compare") / "results.json"),
        work.sessions,
        work.entries,
        work.out / "figures",
        work.inputs,
    )
    for name in AS_CSV:
        tables.write_csv(name, material.table(name), work.out / "tables")
    sections = tuple(section for make in SECTIONS if (section := make(material)) is not None)
    sections += glossary.of(sections)
    carry_out([*material.drawings, Job(traces.write, (material, work.out / traces.PAGE))], pool)
    subtitle = f"Study “{work.study_name}”"
    document = Document(work.study.title, subtitle, ORIGINS[work.study.data_origin], sections)
    (work.out / paste.BIBLIOGRAPHY).write_text(paste.bibtex(material), encoding="utf-8")
    html.render(document, work.out / "figures", work.out / "report.html")
    pdf.render(document, work.out / "figures", work.out / "report.pdf")
    participants.write(material, work.out / participants.FOLDER)

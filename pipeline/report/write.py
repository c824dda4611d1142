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

_FROM_COMPARE = (
    "trials",
    "measures",
    "descriptives",
    "comparisons",
    "comparisons_all_data",
    "accuracy",
    "replay_agreement",
    "sensor_noise",
    "phones",
    "accuracy_means",
    "calibration",
    "shown_at_selection",
    "quality",
    "exclusions",
    "printed",
    "design_check",
    "simulated_reductions",
)

_MANY = 8  # sessions: with fewer all is drawn before another process is ready


def run(work: Work) -> Outcome:
    """The report's files; those of a study with many sessions are drawn in two processes."""
    with another_process(len(work.sessions) >= _MANY, "pipeline.report.sections") as pool:
        _write(work, pool)
    return Outcome()


def _write(work: Work, pool: Executor | None) -> None:
    """report.html, traces.html, participants/*.html, report.pdf, references.bib, tables/*.csv and figures/*.svg."""
    compared = work.entry("compare")
    for folder in ("tables", "figures"):
        (work.out / folder).mkdir()
    for name in _FROM_COMPARE:
        tables.write_csv(name, tables.read(name, compared), work.out / "tables")
    tables.write_csv("selections", tables.read("selections", work.entry("measure")), work.out / "tables")
    material = Material(
        work.study_name,
        work.study,
        results.read(compared / "results.json"),
        tables.read("measures", compared),
        work.sessions,
        work.entries["ingest"],
        work.entries["fuse"],
        work.entries["assess"],
        work.out / "figures",
        work.inputs,
        (compared, work.entry("measure")),
    )
    sections = tuple(section for make in SECTIONS if (section := make(material)) is not None)
    sections += glossary.of(sections)
    carry_out([*material.drawings, Job(traces.write, (material, work.out / traces.PAGE))], pool)
    subtitle = f"Study “{work.study_name}”"
    document = Document(work.study.title, subtitle, ORIGINS[work.study.data_origin], sections)
    (work.out / paste.BIBLIOGRAPHY).write_text(paste.bibtex(material), encoding="utf-8")
    html.render(document, work.out / "figures", work.out / "report.html")
    pdf.render(document, work.out / "figures", work.out / "report.pdf")
    participants.write(material, work.out / participants.FOLDER)

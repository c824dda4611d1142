"""The report: sections from tables, one document, two renderings, tables as CSV and figures as SVG."""

from __future__ import annotations

from pipeline import results, tables
from pipeline.document import html, pdf
from pipeline.document.model import Document
from pipeline.sections import SECTIONS
from pipeline.sections.material import ORIGINS, Material
from pipeline.stage import Outcome, Work

_FROM_COMPARE = (
    "trials",
    "measures",
    "descriptives",
    "comparisons",
    "accuracy",
    "replay_agreement",
    "sensor_noise",
    "phones",
    "accuracy_means",
    "shown_at_selection",
    "quality",
    "exclusions",
    "printed",
    "design_check",
)


def run(work: Work) -> Outcome:
    """report.html, report.pdf, tables/*.csv and figures/*.svg."""
    compared = work.entry("compare")
    for folder in ("tables", "figures"):
        (work.out / folder).mkdir()
    for name in _FROM_COMPARE:
        tables.write_csv(name, tables.read(name, compared), work.out / "tables")
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
    )
    sections = tuple(section for make in SECTIONS if (section := make(material)) is not None)
    subtitle = f"Study “{work.study_name}”"
    document = Document(work.study.title, subtitle, ORIGINS[work.study.data_origin], sections)
    html.render(document, work.out / "figures", work.out / "report.html")
    pdf.render(document, work.out / "figures", work.out / "report.pdf")
    return Outcome()

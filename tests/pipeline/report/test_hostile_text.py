"""Text of a study stays text, whatever stands in it, in every output."""

from __future__ import annotations

import csv
import io
import json
import math
import re
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pytest
from pypdf import PdfReader

from pipeline.report.document import html, pdf
from pipeline.report.document.model import (
    Column,
    Document,
    Figure,
    KeyFigure,
    KeyFigures,
    Notice,
    Paragraph,
    Section,
    Strong,
    Table,
)
from tests.pipeline.helpers import Steadyhand
from tests.pipeline.hostile import CONDITIONS, ESTIMATOR, HOSTILE, PEOPLE, SESSION, hostile_study
from tests.pipeline.report.pages import checked, script


@pytest.fixture
def hostile_document(tmp_path: Path) -> Document:
    svg = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 10 10"><rect width="5" height="5"/></svg>'
    (tmp_path / "a.svg").write_text(svg)
    text = "|".join(HOSTILE)
    return Document(
        text,
        text,
        text,
        (
            Section(
                "s",
                text,
                (
                    Paragraph((text, Strong(text))),
                    Notice(text, ((text,), (Strong(text),))),
                    Notice(text, ((text,),), "information"),
                    KeyFigures((KeyFigure(text[:40], text, text),)),
                    Table("t", text, (Column(text, False), Column("n")), ((text, "1"), ("b", text)), text),
                    Figure("f", "a.svg", text, text),
                ),
            ),
        ),
    )


def test_hostile_text_stays_text_in_html(hostile_document: Document, tmp_path: Path) -> None:
    html.render(hostile_document, tmp_path, tmp_path / "r.html")
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    found = checked(page)
    assert found.scripts == [script("report.js")]
    assert not found.handlers
    assert found.tags.count("img") == 1
    assert "b" not in {tag for tag in found.tags if tag == "bold"}
    seen = "".join(found.text)
    for text in HOSTILE:
        assert text.replace("\a", "□").replace("\u202e", "□") in seen, text
    assert "\u202e" not in page
    assert "49" not in re.sub(r"\s", "", seen.split("{{ 7 * 7 }}")[0][-10:])


def test_hostile_text_stays_text_in_pdf(hostile_document: Document, tmp_path: Path) -> None:
    pdf.render(hostile_document, tmp_path, tmp_path / "r.pdf")
    text = "".join(page.extract_text() for page in PdfReader(tmp_path / "r.pdf").pages)
    for expected in ("#panic()", "<script>", "$x^2$ *strong* _emph_", "{{ 7 * 7 }}", "□bell"):
        assert expected in text
    assert "is shown as □" in text


def test_hostile_text_of_a_whole_study_reaches_every_output_as_text(tmp_path: Path, steadyhand: Steadyhand) -> None:
    """Titles, notes, ids, measures, reasons and a log's facts, with markup, formulas and paths."""
    ran = steadyhand("report", hostile_study(tmp_path / "study"))
    assert ran.code == 0, ran.err
    out = steadyhand.out
    _is_text_in_the_page(out / "report.html")
    _is_text_in_the_traces(out / "traces.html")
    reader = PdfReader(out / "report.pdf")
    printed = "".join("".join(page.extract_text() for page in reader.pages).split())
    for text in ("<script>alert(1)</script>", "#panic()", "{{7*7}}", '#image("/etc/passwd")'):
        assert text in printed
    for path in (out / "tables").iterdir():
        for row in csv.reader(io.StringIO(path.read_text(encoding="utf-8"))):
            for cell in row:
                assert not cell.startswith(("=", "+", "-", "@", "\t", "\r")) or math.isfinite(float(cell)), path.name
    for path in (out / "figures").iterdir():
        tags = {element.tag.rpartition("}")[2] for element in ElementTree.parse(path).iter()}  # noqa: S314 - ours
        assert not tags & {"script", "foreignObject", "a", "b", "i", "u", "img"}, path.name
    with zipfile.ZipFile(out / "report.zip") as archive:
        assert all(re.fullmatch(r"study/([\w-]+/)?[\w.-]+", name) for name in archive.namelist())
    outside = [path for path in out.parent.rglob("*.svg") if not path.is_relative_to(out / "figures")]
    assert not [path for path in outside if "cache" not in path.parts]


def _is_text_in_the_page(path: Path) -> None:
    page = checked(path.read_text(encoding="utf-8"))
    assert page.scripts == [script("report.js")]
    assert not page.handlers
    assert not {"i", "u", "object", "iframe"} & set(page.tags)
    seen = "".join(page.text)
    for text in (*HOSTILE[:13], HOSTILE[-1], *CONDITIONS, PEOPLE[1], ESTIMATOR, SESSION):
        assert text.replace("\u202e", "□") in seen, text


def _is_text_in_the_traces(path: Path) -> None:
    page = checked(path.read_text(encoding="utf-8"))
    data, code = page.scripts
    assert code == "".join(map(script, ("shapes.js", "scene.js", "player.js", "traces.js")))
    assert not page.handlers
    assert not {"img", "i", "b", "u"} & set(page.tags)
    packed = json.loads(data)
    assert [one["session"] for one in packed] == [f"{SESSION}0", f"{SESSION}1"]
    assert packed[0]["participant"] == PEOPLE[0]
    assert {series["name"] for series in packed[0]["series"]} == {"tracker", "reference", ESTIMATOR, "fusion"}
    for banned in ("innerHTML", "outerHTML", "insertAdjacent", "document.write", "eval(", "fetch(", "XMLHttp"):
        assert banned not in code

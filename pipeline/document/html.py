"""A document as one self-contained HTML file: no script, no network."""

from __future__ import annotations

import base64
from pathlib import Path

import jinja2

from pipeline.document.model import CrossReference, Document, Strong, numbered

_CONTROLS = {code: "□" for code in (*range(32), *range(127, 160)) if chr(code) not in "\n\t"}
_HERE = Path(__file__).parent


def render(document: Document, figures: Path, path: Path) -> None:
    """Write the page; `figures` is the folder of the SVG files it shows."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_HERE),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.tests["strong"] = lambda part: isinstance(part, Strong)
    environment.tests["cross_reference"] = lambda part: isinstance(part, CrossReference)
    environment.filters["kind"] = lambda block: type(block).__name__

    def picture(name: str) -> str:
        """An SVG as a data address: as an image of its own, its ids cannot clash with another's."""
        return "data:image/svg+xml;base64," + base64.b64encode((figures / name).read_bytes()).decode()

    page = environment.get_template("report.html.jinja").render(
        document=document,
        names=numbered(document),
        style=(_HERE / "style.css").read_text(encoding="utf-8"),
        picture=picture,
    )
    path.write_text(page.translate(_CONTROLS), encoding="utf-8")

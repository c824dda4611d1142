"""Renders a document as one HTML file, which works without its script and loads nothing from elsewhere."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup, escape

from pipeline.report.document.model import CrossReference, Document, Figure, Link, Strong, numbered, repeats, unfolded
from pipeline.report.document.pictures import pictures
from pipeline.report.document.typography import Run, Style, typeset, typeset_heading
from pipeline.report.glyphs import FAMILY, FONTS

# Direction controls would reverse the text and numbers that follow.
_DIRECTIONS = (*range(0x202A, 0x202F), *range(0x2066, 0x206A))
_CONTROLS = {code: "□" for code in (*range(32), *range(127, 160), *_DIRECTIONS) if chr(code) not in "\n\t"}
_UNBROKEN = {0x2009: "\u202f"}  # the space that groups a number's digits: no line may break there
_TAGS: dict[Style, str] = {"italic": "var", "subscript": "sub"}
_HERE = Path(__file__).parent
_FACES = (
    ("SteadyhandSans-Regular.woff2", "normal", "400"),
    ("SteadyhandSans-Semibold.woff2", "normal", "500 700"),
    ("SteadyhandSans-Italic.woff2", "italic", "400 700"),
)


def render(document: Document, figures: Path, path: Path) -> None:
    """Write the page; `figures` is the folder of the SVG files it shows."""

    blocks = (block for section in document.sections for block in unfolded(section.blocks))
    shown = pictures(figures, [block.file for block in blocks if isinstance(block, Figure)])
    values = {"document": document, "names": numbered(document), "pictures": shown}
    write_page("report.html.jinja", ("report.js",), path, document.origin, **values)


def write_page(template: str, scripts: Sequence[str], path: Path, origin: str, **values: Any) -> None:
    """Write a page from a template, with style and scripts inside; control characters in its text are shown as □.

    The scripts' files follow one another in a single element.

    The page's content security policy forbids any other script or style and every request, whatever text it holds.
    `origin` stands at the foot of each page that a browser prints.
    """
    style, *parts = ((_HERE / name).read_text(encoding="utf-8") for name in ("style.css", *scripts))
    code = "".join(parts)
    style = f"{_fonts()}{style}"
    style += f"@page {{ @bottom-left {{ content: {_quoted(origin)}; }} }}\n"
    policy = (
        f"default-src 'none'; img-src data:; font-src data:; style-src {_hashed(style)}; script-src {_hashed(code)};"
        " base-uri 'none'; form-action 'none'"
    )
    page = (
        _environment().get_template(template).render(style=style, script=code, policy=policy, origin=origin, **values)
    )
    before, _, after = page.partition(style)  # nearly all of a page, and all of it our own
    changed = (part.translate(_CONTROLS | _UNBROKEN) for part in (before, after))
    path.write_text(style.join(changed), encoding="utf-8")


@cache
def _fonts() -> str:
    """The faces of the reports' family as CSS, within the page, which loads nothing."""
    return "".join(
        f'@font-face {{ font-family: "{FAMILY}"; font-style: {style}; font-weight: {weight};'
        f" src: url(data:font/woff2;base64,{base64.b64encode((FONTS / file).read_bytes()).decode()}); }}\n"
        for file, style, weight in _FACES
    )


def _quoted(text: str) -> str:
    """A string for CSS; everything but letters and spaces is escaped by its code."""
    return '"' + "".join(c if c.isalpha() or c == " " else f"\\{ord(c):x} " for c in text) + '"'


def _hashed(text: str) -> str:
    """The entry of a policy that allows exactly this text."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _marked(runs: Iterable[Run]) -> Markup:
    """Words with the symbols of statistics marked; whatever else they hold is escaped."""
    marked = Markup()
    for run in runs:
        tag = _TAGS.get(run.style)
        marked += Markup("<{0}>{1}</{0}>").format(tag, run.text) if tag else escape(run.text)
    return marked


@cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_HERE),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.tests["strong"] = lambda part: isinstance(part, Strong)
    environment.tests["link"] = lambda part: isinstance(part, Link)
    environment.tests["cross_reference"] = lambda part: isinstance(part, CrossReference)
    environment.filters["kind"] = lambda block: type(block).__name__
    environment.filters["repeats"] = lambda table: tuple(repeats(table))
    environment.filters["typeset"] = lambda text: _marked(typeset(text))
    environment.filters["typeset_heading"] = lambda text: _marked(typeset_heading(text))
    return environment

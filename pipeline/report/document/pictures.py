"""Figures as data URLs within a page's budget: as they were drawn, and where all of these are too many, as pixels.

An SVG of many marks is large: forty measures of three hundred people are fifteen megabytes, which no mail takes and no
phone scrolls. So the largest figures of a page become pictures of pixels, one after the other, until the page is
within its budget. Their files beside the page stay as they were drawn, and so do they in print.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from pipeline.report.document.compact_svg import compact
from pipeline.report.document.typst_compiler import compiler_of
from pipeline.report.figures.named_marks import Marks, named_marks

BUDGET_BYTES = 3_500_000
"""Of all figures of a page; its text and tables come to less than a megabyte."""
_NAMED_MAX = 4000  # marks of a page: with their names, some 300 kilobytes
_PIXELS_PER_INCH = 150
_COLOURS = 128  # of a figure with a handful of colours and their mixtures at edges
_SAFE = " '()*,;:@&=+$/?!~-_.[]{}|^\\`\n"  # what a URL of data in an attribute may hold as it is, for it to stay short


@dataclass(frozen=True)
class Picture:
    """A figure in a page, whether it is drawn as pixels, and its marks that have a name."""

    url: str
    is_pixels: bool
    marks: Marks | None = None


def pictures(figures: Path, names: Sequence[str], budget_bytes: int = BUDGET_BYTES) -> dict[str, Picture]:
    """The figures of these file names in a folder, each for a page; together within the budget if pixels can do it."""
    marks = _marks_of(figures, names)
    found = {name: Picture(_url_of(figures / name), False, marks.get(name)) for name in names}
    total = sum(len(picture.url) for picture in found.values())
    drawn = [name for name in found if name.endswith(".svg")]
    for name in sorted(drawn, key=lambda name: -len(found[name].url)):
        if total <= budget_bytes:
            break
        pixels = Picture(_pixel_url(figures, name), True, marks.get(name))
        if len(pixels.url) < len(found[name].url):
            total += len(pixels.url) - len(found[name].url)
            found[name] = pixels
    return found


def _marks_of(figures: Path, names: Sequence[str]) -> dict[str, Marks]:
    """The named marks of the drawings, from the first of them on as far as the page's budget for these goes."""
    found, left = {}, _NAMED_MAX
    for name in names:
        marks = named_marks((figures / name).read_text(encoding="utf-8")) if name.endswith(".svg") else None
        if marks is not None and len(marks.every) <= left:
            found[name] = marks
            left -= len(marks.every)
    return found


def _url_of(path: Path) -> str:
    """As it is: a drawing, or a picture of the study's own."""
    if path.suffix == ".svg":
        return _vector_url(compact(path.read_text(encoding="utf-8")))
    kind = "png" if path.suffix == ".png" else "jpeg"
    return f"data:image/{kind};base64," + base64.b64encode(path.read_bytes()).decode()


def _vector_url(svg: str) -> str:
    """As an image of its own the ids in it cannot clash with those of another figure."""
    return "data:image/svg+xml;charset=utf-8," + quote(svg, safe=_SAFE)


def _pixel_url(figures: Path, name: str) -> str:
    """A PNG, made by the program that sets the PDF, with the same fonts."""
    from PIL import Image

    source = f'#set page(width: auto, height: auto, margin: 0pt, fill: white)\n#image("/{name}")'
    compiler = compiler_of(source.encode(), figures)
    drawn = compiler.compile(format="png", ppi=_PIXELS_PER_INCH)
    assert isinstance(drawn, bytes)  # noqa: S101 - one figure gives one page
    few_colours = Image.open(io.BytesIO(drawn)).convert("RGB").quantize(_COLOURS)
    written = io.BytesIO()
    few_colours.save(written, format="PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(written.getvalue()).decode()

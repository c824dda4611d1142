"""A saved figure as tests look at it."""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path
from xml.etree import ElementTree

from matplotlib.figure import Figure

from pipeline.report import figures

SVG = "{http://www.w3.org/2000/svg}"


def texts(figure: Figure, folder: Path) -> list[str]:
    """Every text of a figure, as its SVG names it beside the outlines of the letters."""
    content = saved(figure, folder).read_text(encoding="utf-8")
    return [unescape(text) for text in re.findall(r"<!-- (.*?) -->", content, flags=re.DOTALL)]


def saved(figure: Figure, folder: Path) -> Path:
    """The figure's file, which is XML whatever names are in it."""
    path = folder / "figure.svg"
    figures.save(figure, path)
    assert ElementTree.parse(path).getroot().tag == f"{SVG}svg"  # noqa: S314 - our own file
    return path


def pictures(path: Path) -> int:
    """How many pictures of pixels are in an SVG."""
    return len(list(ElementTree.parse(path).getroot().iter(f"{SVG}image")))  # noqa: S314 - our own file

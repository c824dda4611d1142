"""Who each mark of a figure is: titles in its SVG, which a browser shows where a mark is pointed at."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from html import escape, unescape
from typing import NamedTuple

from matplotlib.collections import PathCollection

from pipeline.words.numbers import number

_MOST = 500  # marks of one scatter: of more, none stands by itself
_NAMES = "names-"
_GROUP = re.compile(f'<g id="{_NAMES}([0-9a-f]*)">')
_USE = re.compile(r"(<use [^>]*?)/>")
_NAMED = re.compile(r'<use [^>]*?x="([-\d.e]+)" y="([-\d.e]+)"[^>]*><title>(.*?)</title></use>')
_SIZE = re.compile(r'viewBox="0 0 ([\d.]+) ([\d.]+)"')


def name_marks(marks: PathCollection, names: Sequence[str]) -> None:
    """Give each mark of a scatter its name, in their order; `titled` writes them into the figure's SVG."""
    if len(names) <= _MOST:
        marks.set_gid(_NAMES + json.dumps(list(names)).encode().hex())


def people(names: Iterable[object], values: Iterable[float], unit: str = "") -> list[str]:
    """`P03: 44.21 s`, for each participant and value."""
    after = f" {unit}" if unit else ""
    return [f"{name}: {number(value)}{after}" for name, value in zip(names, values, strict=True)]


def titled(svg: str) -> str:
    """An SVG as matplotlib writes it, with a title in each mark that has a name."""
    parts, at = [], 0
    for place, group in enumerate(_GROUP.finditer(svg), 1):
        end = svg.index("</g>", group.end())
        names: list[str] = json.loads(bytes.fromhex(group.group(1)))
        marks = svg[group.end() : end]
        if len(_USE.findall(marks)) == len(names):  # else some lie outside the panel, and none can be told
            titles = iter(names)
            marks = _USE.sub(lambda use: f"{use.group(1)}><title>{escape(next(titles))}</title></use>", marks)  # noqa: B023
        parts += [svg[at : group.start()], f'<g id="people_{place}">', marks]
        at = end
    return "".join([*parts, svg[at:]])


class Mark(NamedTuple):
    """Where a named mark of a figure is, in the figure's own unit, and its name."""

    x: float
    y: float
    name: str


class Marks(NamedTuple):
    """The named marks of a figure, and its width and height in the same unit."""

    width: float
    height: float
    every: tuple[Mark, ...]


def named_marks(svg: str) -> Marks | None:
    """The named marks of a figure's SVG; None without any."""
    size = _SIZE.search(svg)
    found = tuple(Mark(float(x), float(y), unescape(name)) for x, y, name in _NAMED.findall(svg))
    return Marks(float(size.group(1)), float(size.group(2)), found) if size and found else None

"""A document as a tagged PDF (PDF/UA-1, PDF/A-2a), typeset by typst; equal documents give equal bytes."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

from pipeline.report.document.for_print import for_print
from pipeline.report.document.model import (
    Block,
    CrossReference,
    Document,
    Figure,
    Folded,
    KeyFigures,
    Notice,
    Pages,
    Paragraph,
    Section,
    Strong,
    Table,
    Text,
    ToPaste,
    numbered,
    repeats,
)
from pipeline.report.document.typography import Run, typeset, typeset_heading
from pipeline.report.document.typst_compiler import compiler_of
from pipeline.report.glyphs import showable

_HERE = Path(__file__).parent
_UNBROKEN = 24  # characters: a longer word in a table may break after punctuation
LINE_DIGITS = 148  # digits of the smallest type in a table's line
_TEXT_MAX = 100  # characters that a column of text is wide: else its neighbours are left a word a line
_PADDING = 2.5  # characters between columns
_NARROW = frozenset(" .,;:'|!ijl[]()\u00a0\u2009\u202f_")
_BOLD = 1.2  # the width of bold letters in that of numbers
_FIGURES_PASSED = 4  # between a figure and the words that may go before it
_HEAD = 70  # characters of the title that fit at the head of a page beside the section's
_STANDARDS: list[Literal["ua-1", "a-2a"]] = ["ua-1", "a-2a"]


def render(document: Document, figures: Path, path: Path) -> None:
    """Write the PDF; `figures` is the folder of the SVG files it shows, and typst can read nothing else."""
    # A line may break at a thin space, which within a number it must not.
    content = _map_texts(_content(document), lambda text: text.replace("\u2009", "\u202f"))
    printed = _map_texts(content, showable)
    printed |= {"lacking": printed != content, "unbroken": _UNBROKEN}
    compiler = compiler_of(
        (_HERE / "report.typ").read_bytes(), figures, document=json.dumps(printed, ensure_ascii=False)
    )
    pdf = compiler.compile(format="pdf", pdf_standards=[*_STANDARDS], timestamp=0)
    assert isinstance(pdf, bytes)  # noqa: S101 - one document gives one PDF
    path.write_bytes(pdf)


def _map_texts(value: Any, change: Callable[[str], str]) -> Any:
    """The same data with every text changed."""
    if isinstance(value, str):
        return change(value)
    if isinstance(value, list):
        return [_map_texts(item, change) for item in value]
    return {key: _map_texts(item, change) for key, item in value.items()} if isinstance(value, dict) else value


def _content(document: Document) -> dict[str, Any]:
    """The document as plain data; typst takes it as text, never as markup."""
    names = numbered(document)
    return {
        "title": document.title,
        "running": document.title if len(document.title) <= _HEAD else f"{document.title[:_HEAD]}…",
        "subtitle": document.subtitle,
        "origin": document.origin,
        "sections": list(_sections(for_print(document, names).sections, names)),
    }


def _sections(sections: Sequence[Section], names: dict[str, str]) -> Iterator[dict[str, Any]]:
    for place, section in enumerate(sections):
        blocks = [_block(block, names) for block in section.blocks]
        after = [block for one in sections[place + 1 : place + 2] for block in one.blocks]
        for at, (data, block) in enumerate(zip(blocks, section.blocks, strict=True)):
            if isinstance(block, Figure):  # the summary keeps its order
                data["floats"] = place > 0 and _floats(section.blocks[at + 1 :], after, is_first=at == 0)
        yield {"id": section.id, "title": section.title, "blocks": blocks}


def _floats(rest: Sequence[Block], after: Sequence[Block], is_first: bool) -> bool:
    """Whether a figure may go to the foot of a page while words go on: those that follow it, or four more figures.

    `rest` follows in its section and `after` in the next one. A section whose words are over does not go on without
    its first figure.
    """
    following = rest[:1] if is_first else [*rest, *after][: _FIGURES_PASSED + 1]
    words = next((block for block in following if not isinstance(block, Figure)), None)
    return isinstance(words, Paragraph | Table)


def _text(text: Text) -> list[dict[str, Any]]:
    return [
        {
            "text": _typeset(part if isinstance(part, str) else part.text),
            "strong": isinstance(part, Strong),
            "anchor": part.anchor if isinstance(part, CrossReference) else "",
        }
        for part in text
    ]


def _block(block: Block, names: dict[str, str]) -> dict[str, Any]:
    """A block as plain data, its kind among them."""
    data: dict[str, Any]
    match block:
        case Paragraph():
            data = {"kind": "paragraph", "text": _text(block.text)}
        case Notice():
            texts = [_text(text) for text in block.texts]
            data = {"kind": "notice", "title": block.title, "care": block.kind == "care", "texts": texts}
        case KeyFigures():
            keys = [{key: _typeset(text) for key, text in vars(figure).items()} for figure in block.figures]
            data = {"kind": "key-figures", "figures": keys}
        case ToPaste():
            data = {"kind": "to-paste", "texts": [_text(text) for text in block.texts]}
        case Table():
            data = {"kind": "table", "name": names[block.id], **_table(block)}
        case Figure():
            picture = {"name": names[block.id], "file": block.file, "alt": block.alt}
            data = {"kind": "figure", "caption": _typeset(block.caption), **picture}
        case Folded() | Pages():
            raise TypeError("is not printed: see for_print")
    return data


def _table(table: Table) -> dict[str, Any]:
    return {
        "caption": _typeset(table.caption),
        "columns": [
            {"title": _as_data(typeset_heading(column.title)), "numeric": column.numeric} for column in table.columns
        ],
        "rows": [[_typeset(cell) for cell in row] for row in table.rows],
        "again": list(repeats(table)),
        "note": _typeset(table.note),
        "anchors": list(table.anchors),
        "shares": shares_of(table),
    }


def _typeset(text: str) -> list[list[str]]:
    return _as_data(typeset(text))


def _as_data(runs: Iterable[Run]) -> list[list[str]]:
    """Words and how they are set, as plain data."""
    return [[run.text, run.style] for run in runs]


def shares_of(table: Table) -> list[float]:
    """Relative widths of the columns, about the characters they hold: text may wrap, but not within numbers or words.

    Where all columns are wider than a line of the smallest type, text wraps sooner, so that numbers keep their width.
    """
    widest = [_widest(table, index) for index in range(len(table.columns))]
    least = [least_width(table, index) for index in range(len(table.columns))]
    slack = sum(widest) - sum(least)
    too_wide = max(sum(widest) - LINE_DIGITS, 0.0)
    given_up = min(too_wide / slack, 1.0) if slack else 0.0
    return [wide - given_up * (wide - narrow) for wide, narrow in zip(widest, least, strict=True)]


def _widest(table: Table, index: int) -> float:
    """A column's width where there is room: numbers whole, text in few lines."""
    cells = [width_in_digits(row[index]) for row in table.rows]
    longest, typical = max(cells, default=1), sum(cells) / max(len(cells), 1)
    width = longest if table.columns[index].numeric else min(longest, max(12, 1.6 * typical), _TEXT_MAX)
    return max(float(width + _PADDING), least_width(table, index))


def least_width(table: Table, index: int) -> float:
    """The width below which a number or a word would be broken, or a heading, which is bold, overprint the next."""
    texts, column = [row[index] for row in table.rows], table.columns[index]
    whole = max(map(width_in_digits, texts), default=1) if column.numeric else min(_longest_word(texts), _UNBROKEN)
    return max(whole, _BOLD * _longest_word([column.title])) + _PADDING


def width_in_digits(text: str) -> float:
    """A text's width in that of a digit: spaces and marks are narrower."""
    return sum(0.55 if character in _NARROW else 1.0 for character in text)


def _longest_word(texts: Sequence[str]) -> float:
    """The widest of what typesetting keeps on one line."""
    lines = ("".join(run.text for run in typeset(text)) for text in texts)
    return max((width_in_digits(word) for line in lines for word in line.split(" ")), default=1.0)

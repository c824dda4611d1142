"""A document as a tagged PDF (PDF/UA-1, PDF/A-2a), typeset by typst; equal documents give equal bytes."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
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
)
from pipeline.report.document.typography import Run, typeset, typeset_heading
from pipeline.report.glyphs import font_folder, showable

_HERE = Path(__file__).parent
_UNBROKEN = 24  # characters: a longer word in a table may break after punctuation
_HEAD = 70  # characters of the title that fit at the head of a page beside the section's
_STANDARDS: list[Literal["ua-1", "a-2a"]] = ["ua-1", "a-2a"]


def render(document: Document, figures: Path, path: Path) -> None:
    """Write the PDF; `figures` is the folder of the SVG files it shows, and typst can read nothing else."""
    import typst

    # A line may break at a thin space, which within a number it must not.
    content = _map_texts(_content(document), lambda text: text.replace("\u2009", "\u202f"))
    printed = _map_texts(content, showable)
    printed |= {"lacking": printed != content, "unbroken": _UNBROKEN}
    compiler = typst.Compiler(
        (_HERE / "report.typ").read_bytes(),
        root=figures.resolve(),
        font_paths=typst.Fonts(include_system_fonts=False, font_paths=[font_folder()]),
        ignore_system_fonts=True,
        sys_inputs={"document": json.dumps(printed, ensure_ascii=False)},
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
        "sections": [_section(section, names) for section in for_print(document, names).sections],
    }


def _section(section: Section, names: dict[str, str]) -> dict[str, Any]:
    blocks = [_block(block, names) for block in section.blocks]
    return {"id": section.id, "title": section.title, "blocks": blocks}


def _text(text: Text) -> list[dict[str, Any]]:
    return [
        {
            "text": _runs(typeset(part if isinstance(part, str) else part.text)),
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
            keys = [{key: _runs(typeset(text)) for key, text in vars(figure).items()} for figure in block.figures]
            data = {"kind": "key-figures", "figures": keys}
        case ToPaste():
            data = {"kind": "to-paste", "texts": [_text(text) for text in block.texts]}
        case Table():
            data = {"kind": "table", "name": names[block.id], **_table(block)}
        case Figure():
            picture = {"name": names[block.id], "file": block.file, "alt": block.alt}
            data = {"kind": "figure", "caption": _runs(typeset(block.caption)), **picture}
        case Folded() | Pages():
            raise TypeError("is not printed: see for_print")
    return data


def _table(table: Table) -> dict[str, Any]:
    return {
        "caption": _runs(typeset(table.caption)),
        "columns": [
            {"title": _runs(typeset_heading(column.title)), "numeric": column.numeric} for column in table.columns
        ],
        "rows": [[_runs(typeset(cell)) for cell in row] for row in table.rows],
        "note": _runs(typeset(table.note)) if table.note else [],
        "anchors": list(table.anchors),
        "shares": _shares(table),
    }


def _runs(runs: Iterable[Run]) -> list[list[str]]:
    """Words and how they are set, as plain data."""
    return [[run.text, run.style] for run in runs]


def _shares(table: Table) -> list[float]:
    """Relative widths of the columns, from their longest cells: text may wrap, but not within numbers or words."""
    widths = []
    for index, column in enumerate(table.columns):
        texts = [row[index] for row in table.rows]
        cells = [len(text) for text in texts]
        longest, heading = max(cells, default=1), _longest_word([column.title])
        typical = sum(cells) / max(len(cells), 1)
        width = longest if column.numeric else min(longest, max(12, 1.6 * typical))
        widths.append(float(max(width, heading, min(_longest_word(texts), _UNBROKEN)) + 3))
    return widths


def _longest_word(texts: Sequence[str]) -> int:
    return max((len(word) for text in texts for word in text.split()), default=1)

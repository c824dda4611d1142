"""A document as a tagged PDF (PDF/UA-1, PDF/A-2a), typeset by typst; equal documents give equal bytes."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Literal

from pipeline.report.document.model import (
    CrossReference,
    Document,
    Figure,
    KeyFigures,
    Notice,
    Pages,
    Paragraph,
    Strong,
    Table,
    Text,
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

    content = _map_texts(
        _content(document), lambda text: text.replace("\u2009", "\u202f")
    )  # no line breaks within a number
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
        "sections": [
            {
                "id": section.id,
                "title": section.title,
                "blocks": [_block(block, names) for block in section.blocks if not isinstance(block, Pages)],
            }
            for section in document.sections
        ],
    }


def _text(text: Text) -> list[dict[str, Any]]:
    return [
        {
            "text": _runs(typeset(part if isinstance(part, str) else part.text)),
            "strong": isinstance(part, Strong),
            "anchor": part.anchor if isinstance(part, CrossReference) else "",
        }
        for part in text
    ]


def _block(block: Paragraph | Notice | KeyFigures | Table | Figure, names: dict[str, str]) -> dict[str, Any]:
    match block:
        case Paragraph():
            return {"kind": "paragraph", "text": _text(block.text)}
        case Notice():
            return {
                "kind": "notice",
                "title": block.title,
                "care": block.kind == "care",
                "texts": [_text(text) for text in block.texts],
            }
        case KeyFigures():
            return {
                "kind": "key-figures",
                "figures": [
                    {key: _runs(typeset(text)) for key, text in vars(figure).items()} for figure in block.figures
                ],
            }
        case Table():
            return {
                "kind": "table",
                "name": names[block.id],
                "caption": _runs(typeset(block.caption)),
                "columns": [
                    {"title": _runs(typeset_heading(column.title)), "numeric": column.numeric}
                    for column in block.columns
                ],
                "rows": [[_runs(typeset(cell)) for cell in row] for row in block.rows],
                "note": _runs(typeset(block.note)) if block.note else [],
                "anchors": list(block.anchors),
                "shares": _shares(block),
            }
        case Figure():
            return {
                "kind": "figure",
                "name": names[block.id],
                "file": block.file,
                "caption": _runs(typeset(block.caption)),
                "alt": block.alt,
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

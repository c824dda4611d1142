"""The glossary of a report, with the words that it uses and no others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pipeline.report.document.model import (
    Block,
    Figure,
    KeyFigures,
    Notice,
    Paragraph,
    Section,
    Table,
    ToPaste,
    columns,
    plain,
    unfolded,
)
from pipeline.report.prose.glossary import explained

ANCHOR = "glossary"


def of(sections: Sequence[Section]) -> tuple[Section, ...]:
    """A section for the end of a report that has these; none where there is nothing to explain."""
    entries = explained([text for section in sections for block in unfolded(section.blocks) for text in _texts(block)])
    if not entries:
        return ()
    caption = "The statistical words of this report."
    table = Table("table-glossary", caption, columns(("Word", "Meaning"), 2), tuple(entries))
    return (Section(ANCHOR, "Glossary", (table,)),)


def _texts(block: Block) -> Iterator[str]:
    """Every text of a block by itself."""
    match block:
        case Paragraph():
            yield plain(block.text)
        case Notice():
            yield from (block.title, *(plain(text) for text in block.texts))
        case ToPaste():
            yield from (plain(text) for text in block.texts)
        case KeyFigures():
            yield from (text for figure in block.figures for text in (figure.value, figure.label, figure.evidence))
        case Table():
            yield from (block.caption, block.note, *(column.title for column in block.columns))
            yield from (cell for row in block.rows for cell in row)
        case Figure():
            yield block.caption

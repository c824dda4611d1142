"""What of a document is printed: folded tables go to an annex, as far as it may grow, and links to a page go."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from pipeline.report.document.model import (
    Block,
    CrossReference,
    Document,
    Figure,
    Folded,
    Link,
    Pages,
    Paragraph,
    Section,
    Strong,
    Table,
    Text,
    ToPaste,
)
from pipeline.words.phrases import listing

_ANNEX = "annex"
_ROWS_MAX = 250  # of a table: five pages
_TEXTS_MAX = 60  # of words to paste
_ANNEX_ROWS = 48  # of folded tables in all: with their captions, two pages
_FIGURE_ROWS = 10  # of these, what a figure takes the place of
_SHORTEST = 2  # rows of a table that shows at least what it has


def for_print(document: Document, names: Mapping[str, str]) -> Document:
    """The document without `Folded` and `Pages`; `names` has the number of every table and figure."""
    sections = [replace(section, blocks=tuple(_blocks(section.blocks, names))) for section in document.sections]
    folded = [block for section in document.sections for block in section.blocks if isinstance(block, Folded)]
    annex = tuple(_annex(folded))
    if annex:
        sections.append(Section(_ANNEX, "Annex: what is folded away above", annex))
    return replace(document, sections=tuple(sections))


def _annex(folded: Sequence[Folded]) -> Iterator[Block]:
    """What is folded and goes to the annex: tables, as many of their rows as there is room for, and figures."""
    tables = [table for fold in folded if fold.in_annex for table in _tables(fold)]
    whole = [table for fold in folded if fold.in_annex and fold.whole_in_annex for table in _tables(fold)]
    figures = sum(len(_annexed(fold)) for fold in folded)
    taken = _FIGURE_ROWS * figures + sum(len(table.rows) for table in whole)
    others = [table for table in tables if table not in whole]
    shared = max(_ANNEX_ROWS - taken, len(others) * _SHORTEST)
    shortened = {table.id: table for table in [*whole, *_shortened(others, shared)]}
    for fold in folded:
        yield from (shortened[table.id] for table in _tables(fold) if fold.in_annex)
        yield from _annexed(fold)


def _blocks(blocks: Sequence[Block], names: Mapping[str, str]) -> Iterator[Block]:
    for block in blocks:
        if isinstance(block, Folded):
            yield Paragraph((_folded(block, names),))
        elif isinstance(block, ToPaste):
            # A link to a row of the report is of use on a page only, and belongs to no paper.
            texts = tuple(_without_links(text) for text in block.texts[:_TEXTS_MAX])
            yield ToPaste(block.label, texts)
            if len(block.texts) > _TEXTS_MAX:
                yield Paragraph(
                    (f"The first {_TEXTS_MAX} of {len(block.texts)} paragraphs; report.html has them all.",)
                )
        elif isinstance(block, Table):
            yield _first_rows(block, _ROWS_MAX)
        elif not isinstance(block, Pages):
            yield block


def _without_links(text: Text) -> Text:
    """The text without its links to rows and the spaces that set these off."""
    kept: list[str | Strong | Link] = []
    for part in text:
        if isinstance(part, CrossReference):
            if kept and isinstance(kept[-1], str):
                kept[-1] = kept[-1].rstrip(" ")
        else:
            kept.append(part)
    return tuple(kept)


def _folded(block: Folded, names: Mapping[str, str]) -> str:
    """What is folded and where it is to be found: `Each session's lights (Table 1 in the annex).`"""
    tables = [names[table.id] for table in _tables(block)]
    annexed = [names[figure.id] for figure in _annexed(block)]
    figures = [f"figures/{one.file}" for one in block.blocks if isinstance(one, Figure) and one not in _annexed(block)]
    places = [f"{listing(tables)} in {'the annex' if block.in_annex else 'report.html'}"] if tables else []
    places += [f"{listing(annexed)} in the annex"] if annexed else []
    places += [f"{listing(figures)} in report.html"] if figures else []
    where = f" ({'; '.join(places)})" if places else ""
    return f"{block.summary.rstrip('.')}{where}."


def _annexed(block: Folded) -> list[Figure]:
    return [one for one in block.blocks if isinstance(one, Figure)] if block.figures_in_annex else []


def _tables(block: Folded) -> list[Table]:
    return [one for one in block.blocks if isinstance(one, Table) and one.rows]


def _shortened(tables: Sequence[Table], rows: int) -> Iterator[Table]:
    """The tables within so many rows: short ones whole, and the rest is shared by the long ones."""
    room, left = {}, rows
    for place, table in enumerate(sorted(tables, key=lambda table: len(table.rows))):
        room[table.id] = min(len(table.rows), left // (len(tables) - place))
        left -= room[table.id]
    for table in tables:
        yield _first_rows(table, room[table.id])


def _first_rows(table: Table, rows: int) -> Table:
    """The table, or as much of it as is printed, which its caption says then."""
    if len(table.rows) <= rows:
        return table
    caption = f"{table.caption} In print, the first {rows} of {len(table.rows)} rows; all of these are in report.html."
    return replace(table, caption=caption, rows=table.rows[:rows], anchors=table.anchors[:rows])

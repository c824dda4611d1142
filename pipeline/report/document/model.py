"""The blocks that a report is made of. Text is data: only the renderers know markup, and they escape everything."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Strong:
    """Words in bold: those that matter most in a sentence."""

    text: str


@dataclass(frozen=True)
class Link:
    """A link to another file of the report; in print, plain words. `href` is made by the program, never from data."""

    text: str
    href: str


@dataclass(frozen=True)
class CrossReference:
    """Words that link to an anchor in the same document."""

    text: str
    anchor: str


Text = tuple[str | Strong | Link | CrossReference, ...]


def plain(text: Text) -> str:
    """The words without their emphasis and links."""
    return "".join(part if isinstance(part, str) else part.text for part in text)


@dataclass(frozen=True)
class Paragraph:
    """Running text."""

    text: Text


@dataclass(frozen=True)
class Notice:
    """Something to know or to be careful about, in a box."""

    title: str
    texts: tuple[Text, ...]
    kind: Literal["care", "information"] = "care"


@dataclass(frozen=True)
class KeyFigure:
    """A number that people look for first, what it is, and the evidence for it."""

    value: str
    label: str
    evidence: str


@dataclass(frozen=True)
class KeyFigures:
    """A few key figures side by side."""

    figures: tuple[KeyFigure, ...]


@dataclass(frozen=True)
class Column:
    """A table's column; numbers are aligned to the right."""

    title: str
    numeric: bool = True


def columns(titles: Sequence[str], texts: int) -> tuple[Column, ...]:
    """Columns with these titles, of which the first `texts` hold text and the others numbers."""
    return tuple(Column(title, index >= texts) for index, title in enumerate(titles))


@dataclass(frozen=True)
class Table:
    """A caption that says what to see, columns, and rows of text; the first cell of a row is its heading.

    `anchors` has an id for each row of a table that words link to; no two in a document may be equal. With `cards` a
    phone shows each row as a card with all its cells, where other tables scroll.
    """

    id: str
    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    anchors: tuple[str, ...] = ()
    cards: bool = False


def repeats(table: Table) -> Iterator[bool]:
    """Of each row, whether its first cell says the same as the one above, and may be shown quietly."""
    above = None
    for row in table.rows:
        yield len(table.columns) > 1 and row[0] == above
        above = row[0]


@dataclass(frozen=True)
class Figure:
    """A picture by its file name among the report's figures, with what to see in it and a text alternative."""

    id: str
    file: str
    caption: str
    alt: str


@dataclass(frozen=True)
class Pages:
    """Links to further pages of the report; left out in print."""

    label: str
    links: tuple[Link, ...]


@dataclass(frozen=True)
class Folded:
    """Tables and figures that most readers pass over, under a line that says what they hold and what it comes to.

    A page opens them at a click. In print the line stands alone: tables go to an annex, as far as it may grow, unless
    they are of no use on paper, and figures are left to the page, unless a paper's reader needs them as much. What is
    of use only as a whole is not shortened there.
    """

    summary: str
    blocks: tuple[Table | Figure, ...]
    in_annex: bool = True
    figures_in_annex: bool = False
    whole_in_annex: bool = False


@dataclass(frozen=True)
class ToPaste:
    """Words for a paper, which a page copies at a click; cross-references stay beside them and are not copied."""

    label: str
    texts: tuple[Text, ...]


Block = Paragraph | Notice | KeyFigures | Table | Figure | Pages | Folded | ToPaste


def unfolded(blocks: Sequence[Block]) -> Iterator[Block]:
    """The blocks, and in place of each that is folded what it holds."""
    for block in blocks:
        if isinstance(block, Folded):
            yield from block.blocks
        else:
            yield block


@dataclass(frozen=True)
class Section:
    """A heading and what follows."""

    id: str
    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Document:
    """A whole report. `origin` says on every page where the data come from; `back` links to the page it belongs to."""

    title: str
    subtitle: str
    origin: str
    sections: tuple[Section, ...]
    back: Link | None = None


def numbered(document: Document) -> dict[str, str]:
    """`Table 1`, `Figure 1`, … by id, in the order of the document."""
    names: dict[str, str] = {}
    counts = {"Table": 0, "Figure": 0}
    for section in document.sections:
        for block in unfolded(section.blocks):
            if isinstance(block, Table | Figure):
                kind = type(block).__name__
                counts[kind] += 1
                names[block.id] = f"{kind} {counts[kind]}"
    return names

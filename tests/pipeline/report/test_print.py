"""What of a document is printed, and how tables that are folded away share the annex."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pypdf import PdfReader

from pipeline.report.document import pdf
from pipeline.report.document.for_print import for_print
from pipeline.report.document.model import (
    CrossReference,
    Document,
    Figure,
    Folded,
    Link,
    Pages,
    Paragraph,
    Section,
    Table,
    ToPaste,
    columns,
    numbered,
    plain,
)


def a_table(name: str, rows: int) -> Table:
    return Table(name, f"About {name}.", columns(("Row",), 1), tuple((f"{row}",) for row in range(rows)))


def printed(*blocks: Folded | Paragraph | Pages | ToPaste | Table) -> tuple[Section, ...]:
    document = Document("T", "", "Recorded data", (Section("s", "S", blocks),))
    return for_print(document, numbered(document)).sections


def test_a_fold_is_a_line_that_says_where_the_rest_is() -> None:
    picture = Figure("figure-a", "a.svg", "A.", "A")
    (section, annex) = printed(
        Folded("Each session's lights", (a_table("lights", 3),)),
        Folded("What arrived when", (picture,)),
        Folded("Digests", (a_table("digests", 3),), in_annex=False),
        Pages("Participants", (Link("P01", "p01.html"),)),
    )
    assert [block.text for block in section.blocks if isinstance(block, Paragraph)] == [
        ("Each session's lights (Table 1 in the annex).",),
        ("What arrived when (figures/a.svg in report.html).",),
        ("Digests (Table 2 in report.html).",),
    ]
    assert len(section.blocks) == 3
    assert annex.blocks == (a_table("lights", 3),)


def test_a_figure_that_print_needs_too_stands_in_the_annex_beside_its_fold() -> None:
    picture = Figure("figure-a", "a.svg", "A.", "A")
    (section, annex) = printed(
        Folded("Are they normal", (a_table("shapiro", 3), picture), figures_in_annex=True),
        Folded("Each session's lights", (a_table("lights", 3),)),
    )
    assert section.blocks[0] == Paragraph(("Are they normal (Table 1 in the annex; Figure 1 in the annex).",))
    assert annex.blocks == (a_table("shapiro", 3), picture, a_table("lights", 3))


def test_a_table_that_is_of_use_only_whole_is_not_shortened_and_the_others_make_room() -> None:
    (_, annex) = printed(
        Folded("Values", (a_table("values", 30),), whole_in_annex=True), Folded("Lights", (a_table("lights", 90),))
    )
    assert [len(table.rows) for table in annex.blocks if isinstance(table, Table)] == [30, 18]
    (_, annex) = printed(
        Folded("Values", (a_table("values", 60),), whole_in_annex=True), Folded("Lights", (a_table("lights", 90),))
    )
    assert [len(table.rows) for table in annex.blocks if isinstance(table, Table)] == [60, 2]


def test_without_folds_there_is_no_annex() -> None:
    assert len(printed(Paragraph(("All.",)))) == 1


def test_words_to_paste_have_no_links_to_rows() -> None:
    ((section,),) = [printed(ToPaste("Results", (("It differed ", CrossReference("[row]", "comparison-1"), "."),)))]
    assert section.blocks == (ToPaste("Results", (("It differed", "."),)),)


def test_no_space_is_left_before_a_comma_where_a_link_was() -> None:
    link = CrossReference("[row]", "comparison-1")
    ((section,),) = [
        printed(ToPaste("Results", (("Not a and b (n = 10)", " ", link, ", nor c (n = 9)", " ", link, "."),)))
    ]
    (words,) = section.blocks
    assert isinstance(words, ToPaste)
    assert plain(words.texts[0]) == "Not a and b (n = 10), nor c (n = 9)."


def test_no_line_promises_an_empty_table() -> None:
    (section,) = printed(Folded("Remarks: none.", (a_table("remarks", 0),)))
    assert section.blocks == (Paragraph(("Remarks: none.",)),)


def test_a_long_table_and_many_words_are_cut_in_print_and_say_so() -> None:
    ((section,),) = [printed(a_table("pairs", 1770), ToPaste("Results", tuple((f"{n}",) for n in range(61))))]
    table, words, note = section.blocks
    assert isinstance(table, Table)
    assert len(table.rows) == 250
    assert table.caption.endswith(" In print, the first 250 of 1770 rows; all of these are in report.html.")
    assert isinstance(words, ToPaste)
    assert len(words.texts) == 60
    assert note == Paragraph(("The first 60 of 61 paragraphs; report.html has them all.",))


@given(st.lists(st.integers(1, 400), min_size=1, max_size=12))
def test_the_annex_never_outgrows_two_pages_and_says_what_it_left_out(lengths: list[int]) -> None:
    tables = [a_table(f"t{place}", rows) for place, rows in enumerate(lengths)]
    (_, annex) = printed(Folded("All", tuple(tables)))
    shown = [block for block in annex.blocks if isinstance(block, Table)]
    assert sum(len(table.rows) for table in shown) == min(48, sum(lengths))
    by_id = {table.id: table for table in shown}
    for table in tables:
        mine = by_id[table.id]
        assert mine.rows == table.rows[: len(mine.rows)]
        cut = f" In print, the first {len(mine.rows)} of {len(table.rows)} rows; all of these are in report.html."
        assert mine.caption == table.caption + (cut if len(mine.rows) < len(table.rows) else "")
    longest_cut = max((len(by_id[t.id].rows) for t in tables if len(by_id[t.id].rows) < len(t.rows)), default=0)
    shortest_whole = [len(t.rows) for t in tables if len(by_id[t.id].rows) == len(t.rows)]
    assert all(rows <= longest_cut + 1 for rows in shortest_whole) or not longest_cut


@pytest.mark.parametrize("paragraphs", range(24, 38, 2))
def test_a_table_that_goes_over_a_page_leaves_no_row_alone(paragraphs: int, tmp_path: Path) -> None:
    words = tuple(Paragraph(("Words before the table.",)) for _ in range(paragraphs))
    rows = tuple((f"row{at}", "2.5") for at in range(23))
    table = Table("t", "What is in it.", columns(("Name", "Value"), 1), rows)
    pdf.render(Document("d", "", "", (Section("s", "S", (*words, table)),)), tmp_path, tmp_path / "r.pdf")
    texts = [page.extract_text() for page in PdfReader(tmp_path / "r.pdf").pages]
    counts = [len(re.findall(r"row\d+", text)) for text in texts]
    assert sum(counts) == len(rows)
    assert min(count for count in counts if count) >= 3
    captioned = next(at for at, text in enumerate(texts) if "What is in it." in text)
    assert counts[captioned] >= 3
    assert not any(counts[:captioned])


def test_no_figure_overtakes_another(tmp_path: Path) -> None:
    """A section that begins with a figure keeps it there, after those of the section before that float."""
    size = 'width="500pt" height="330pt"'
    (tmp_path / "a.svg").write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {size}></svg>', encoding="utf-8")
    words = tuple(Paragraph((f"Line {at} of words.",)) for at in range(30))
    first, second, third, fourth = (Figure(f"f{at}", "a.svg", "A caption.", "A") for at in range(4))
    sections = (
        Section("summary", "Summary", (Paragraph(("The answer.",)),)),
        Section("one", "One", (*words, first, second, third, Paragraph(("The last words.",)))),
        Section("two", "Two", (fourth,)),
        Section("three", "Three", (*words[:8],)),
    )
    pdf.render(Document("d", "", "", sections), tmp_path, tmp_path / "r.pdf")
    text = " ".join(page.extract_text() for page in PdfReader(tmp_path / "r.pdf").pages)
    assert re.findall(r"Figure (\d)\. ?A caption", text) == ["1", "2", "3", "4"]


def test_words_after_a_figure_fill_the_page_on_which_it_does_not_fit(tmp_path: Path) -> None:
    size = 'width="500pt" height="400pt"'
    (tmp_path / "a.svg").write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {size}></svg>', encoding="utf-8")
    words = tuple(Paragraph((f"Line {at} of words.",)) for at in range(40))
    figure = Figure("f", "a.svg", "A caption.", "A")
    first = Section("summary", "Summary", (Paragraph(("The answer.",)),))
    second = Section("s", "S", (*words[:25], figure, *words[25:]))
    pdf.render(Document("d", "", "", (first, second)), tmp_path, tmp_path / "r.pdf")
    before, after = (page.extract_text() for page in PdfReader(tmp_path / "r.pdf").pages)
    assert "A caption." in after
    assert "Line 26 of words." in before

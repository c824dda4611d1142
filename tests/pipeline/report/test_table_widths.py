"""The columns of a printed table, and rows that begin as the one above."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from pipeline.report.document.model import Column, Table, columns, repeats
from pipeline.report.document.pdf import LINE_DIGITS, least_width, shares_of, width_in_digits


def a_table(rows: tuple[tuple[str, ...], ...], titles: tuple[str, ...], texts: int = 1) -> Table:
    return Table("t", "T.", columns(titles, texts), rows)


def test_a_first_cell_repeats_the_one_above_and_not_an_earlier_one() -> None:
    table = a_table((("a", "1"), ("a", "2"), ("b", "1"), ("a", "1")), ("Measure", "n"))
    assert list(repeats(table)) == [False, True, False, False]


def test_a_table_of_one_column_repeats_nothing() -> None:
    assert list(repeats(a_table((("a",), ("a",)), ("Word",)))) == [False, False]


def test_a_long_text_leaves_its_neighbour_room_for_several_words() -> None:
    table = a_table((("x " * 120, "the method that is implemented"), ("y " * 90, "Holm")), ("Reference", "Used for"), 2)
    reference, used_for = shares_of(table)
    assert used_for / (reference + used_for) * LINE_DIGITS >= width_in_digits("the method that")


WORDS = st.lists(st.text("abcdefgh", min_size=1, max_size=12), min_size=1, max_size=6).map(" ".join)
NUMBERS = st.integers(0, 10**9).map(str)
ROWS = st.lists(st.tuples(WORDS, WORDS, *[NUMBERS] * 8), min_size=1, max_size=6).map(tuple)


@given(ROWS)
def test_no_number_is_narrowed_and_no_word_broken_where_a_line_has_room_for_them(
    rows: tuple[tuple[str, ...], ...],
) -> None:
    table = Table("t", "T.", tuple(Column("Mean", at > 1) for at in range(10)), rows)
    shares = shares_of(table)
    least = [least_width(table, at) for at in range(10)]
    assert all(share >= narrow - 1e-9 for share, narrow in zip(shares, least, strict=True))
    assert sum(shares) <= max(LINE_DIGITS, sum(least)) + 1e-6

"""Guesses of how tables are written and named, and of which log is of whom."""

from __future__ import annotations

import pytest

from pipeline.study.guessing.file_names import guess_pattern
from pipeline.study.guessing.headers import meaning, split_unit
from pipeline.study.guessing.shapes import crossed_headers, tlx_names
from pipeline.study.guessing.text import decimal_of, encoding_of, separator_of


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252", "mac_roman"])
def test_an_encoding_is_guessed_so_that_the_text_comes_out(encoding: str) -> None:
    text = "Teilnehmer;Bemerkung\nVP01;müde, ein Übungsdurchgang\nVP02;schön — größer\n" * 3
    given = text if encoding.startswith("utf") else text.replace("—", "-")
    content = given.encode(encoding)
    assert content.decode(encoding_of(content)).removeprefix("\ufeff") == given


@pytest.mark.parametrize(
    ("text", "separator"),
    [
        ("a,b,c\n1,2,3\n", ","),
        ("a;b;c\n1,5;2,5;3,5\n4,5;5,5;6,5\n", ";"),
        ("a\tb c\td\n1\t2 2\t3\n", "\t"),
        ("a b c\n1 2 3\n", " "),
        ('a,b\n"x; y",2\n"z; w",3\n', ","),
        ("one\ntwo\n", ","),
    ],
)
def test_the_separator_is_what_cuts_lines_alike(text: str, separator: str) -> None:
    assert separator_of(text) == separator


def test_a_decimal_comma_is_told_from_a_point() -> None:
    assert decimal_of(["1,5", "2", "3,25", "VP01"]) == ","
    assert decimal_of(["1.5", "2", "1,234.5"]) == "."
    assert decimal_of(["1", "2"]) == "."


@pytest.mark.parametrize(
    ("header", "column"),
    [
        ("Versuchsperson", "participant"),
        ("subject_ID", "participant"),
        ("Código participante", "participant"),
        ("Numéro sujet", "participant"),
        ("Gerät", "condition"),
        ("Übung", "practice"),
        ("Ziel X [cm]", "target_x_cm"),
        ("x_target", "target_x_mm"),
        ("Début (ms)", "start_ms"),
        ("Zielbreite", "target_width_mm"),
        ("Bemerkung", None),
    ],
)
def test_what_a_header_means(header: str, column: str | None) -> None:
    assert meaning(header) == column


@pytest.mark.parametrize(
    ("header", "parts"),
    [("Zeit (Sek.)", ("Zeit", "s")), ("time_ms", ("time", "ms")), ("rpm", ("rpm", None)), ("ms", ("ms", None))],
)
def test_a_unit_is_split_off(header: str, parts: tuple[str, str | None]) -> None:
    assert split_unit(header) == parts


@pytest.mark.parametrize(
    ("names", "conditions", "pattern", "found"),
    [
        (
            ["d/P01_a.mcap", "d/P01_b.mcap", "d/P02_a.mcap", "d/P02_b.mcap"],
            (),
            "d/{participant}_{condition}.mcap",
            "ab",
        ),
        (["a/P01.mcap", "a/P02.mcap", "b/P01.mcap", "b/P02.mcap"], (), "{condition}/{participant}.mcap", "ab"),
        (
            ["anna_a.mcap", "anna_b.mcap", "bert_a.mcap", "bert_b.mcap"],
            ("a", "b"),
            "{participant}_{condition}.mcap",
            "ab",
        ),
        (["P01_slow.mcap", "P01_fast.mcap"], ("slow", "fast"), "{participant}_{condition}.mcap", ("slow", "fast")),
        (["R01_reach.mcap", "R02_reach.mcap"], (), "{participant}_{condition}.mcap", ("reach",)),
        (
            ["P1_a_1.mcap", "P1_b_2.mcap", "P2_a_2.mcap", "P2_b_1.mcap"],
            (),
            "{participant}_{condition}_{session}.mcap",
            "ab",
        ),
    ],
)
def test_the_pattern_of_logs(names: list[str], conditions: tuple[str, ...], pattern: str, found: str) -> None:
    guess = guess_pattern(names, conditions, ".mcap")
    assert guess is not None
    assert (guess.pattern, guess.conditions) == (pattern, tuple(found))


def test_names_that_are_not_built_alike_have_no_pattern() -> None:
    assert guess_pattern(["a_b.mcap", "c.mcap"], (), ".mcap") is None


def test_columns_of_conditions_and_measures_are_told_apart() -> None:
    crossed = crossed_headers(["time_a", "time_b", "errors_a", "errors_b"], ())
    assert crossed is not None
    assert (crossed.conditions, crossed.entry) == (("a", "b"), {"columns": "{measure}_{condition}"})
    assert crossed_headers(["age", "height"], ()) is None


def test_the_scales_of_the_tlx_in_german() -> None:
    names = ["Geistige Anforderung", "Körperliche", "Zeitliche", "Leistung", "Anstrengung", "Frustration"]
    assert list(tlx_names(names).values()) == [
        "mental",
        "physical",
        "temporal",
        "performance",
        "effort",
        "frustration",
    ]
    assert tlx_names(names[:5]) == {}

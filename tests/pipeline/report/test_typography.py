"""What is set in italics and as a subscript, and that nothing else is changed."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib import font_manager
from matplotlib.ft2font import FT2Font

from pipeline.report.document.typography import typeset, typeset_heading
from pipeline.report.figures.style import FAMILIES
from pipeline.report.glyphs import FONTS


def marked(text: str) -> str:
    """Italics between asterisks, subscripts in brackets after an underscore, and a tilde where no line may break."""
    form = {"": "{}", "italic": "*{}*", "subscript": "_[{}]"}
    return "".join(form[run.style].format(run.text) for run in typeset(text)).replace("\u00a0", "~")


# As the Publication Manual of the American Psychological Association prints them (7th edition, 6.44 and 7.4).
@pytest.mark.parametrize(
    ("text", "printed"),
    [
        ("t(11) = 2.52, p = .0286, n = 12", "*t*(11)~=~2.52, *p*~=~.0286, *n*~=~12"),
        ("F(1.32, 14.6) = 35.06, p < .0001", "*F*(1.32,~14.6)~=~35.06, *p*~<~.0001"),
        ("kinect: M = 42.54, SD = 8.79", "kinect: *M*~=~42.54, *SD*~=~8.79"),
        ("d_z = −0.73 [−1.35, −0.07]", "*d*_[z]~=~−0.73 [−1.35,~−0.07]"),
        ("r_rb = .82, η²G = .10, η²p = .34", "*r*_[rb]~=~.82, *η*²_[G]~=~.10, *η*²_[p]~=~.34"),
        ("W₊ = 59, Greenhouse-Geisser ε = .662", "*W*₊~=~59, Greenhouse-Geisser ε~=~.662"),
        ("lower by 6.10 s, 26.7 %", "lower by 6.10~s, 26.7~%"),
        ("use the Greenhouse-Geisser p.", "use the Greenhouse-Geisser *p*."),
        (
            "zeros dropped, p Holm-adjusted. Then p was corrected",
            "zeros dropped, *p* Holm-adjusted. Then *p* was corrected",
        ),
        ("Mauchly's p is small; p of W", "Mauchly's *p* is small; *p* of W"),
        ("n: participants; p: not adjusted; t tests", "*n*: participants; *p*: not adjusted; *t* tests"),
        ("p adjusted", "*p* adjusted"),
        ("< .0001", "<~.0001"),
        ("p (Holm)", "*p* (Holm)"),
        ("W₊ is a sum; a small p speaks against it", "*W*₊ is a sum; a small *p* speaks against it"),
    ],
)
def test_statistics_are_set_as_papers_print_them(text: str, printed: str) -> None:
    assert marked(text) == printed


@pytest.mark.parametrize(
    "text", ["task_p = x", "P05 and P07", "group n, then p", "plan_n", "the F key", "map = 3x", "d_zone", "SD card"]
)
def test_letters_that_are_no_statistics_are_left_alone(text: str) -> None:
    assert marked(text) == text


def test_a_symbol_alone_is_one_where_it_heads_a_column() -> None:
    assert [run.style for run in typeset_heading("p")] == ["italic"]
    assert marked("p") == "p"


@given(st.text() | st.from_regex(r"([FtpndrMW](_z|_rb|₊|\(1\)| \(2, 3\))? [=<] −?\.5[ ,%s]*)+", fullmatch=True))
def test_only_underscores_and_spaces_change(text: str) -> None:
    def bare(words: str) -> str:
        return words.replace("_", "").replace("\u00a0", " ")

    assert bare("".join(run.text for run in typeset(text))) == bare(text)


def test_an_interval_stays_on_one_line_and_a_list_in_brackets_does_not() -> None:
    (run,) = typeset("it was 1.54 [−0.68, 2.38] and 47 [27\u2009727, 66\u2009538]")
    assert run.text == "it was 1.54 [−0.68,\u00a02.38] and 47 [27\u2009727,\u00a066\u2009538]"
    (run,) = typeset("conditions: [kinect, fusion]")
    assert "\u00a0" not in run.text


def test_pages_pdf_and_figures_are_set_in_one_family_that_comes_with_the_program() -> None:
    (family, _), found = FAMILIES, font_manager.findfont(FAMILIES[0], fallback_to_default=False)
    assert Path(found).parent == FONTS
    document = FONTS.parent / "document"
    assert f'font: ("{family}", ' in (document / "report.typ").read_text(encoding="utf-8")
    assert f'"{family}", system-ui' in (document / "style.css").read_text(encoding="utf-8")


@pytest.mark.parametrize("style", ["Regular", "Semibold"])
def test_the_fonts_have_the_letters_and_symbols_of_reports(style: str) -> None:
    known = FT2Font(str(FONTS / f"SteadyhandSans-{style}.ttf")).get_charmap()
    assert not [symbol for symbol in "ÄéñøŁβηχωε²×−±≤≥–—“”…→✓▲₊µΔσ□" if ord(symbol) not in known]

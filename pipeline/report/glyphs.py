"""The fonts of pages, PDF and figures, and the characters that they can show.

All three are set in one family, which comes with the program (`fonts/`, made by tools/make_fonts.py); letters and
symbols that it lacks are taken from the fonts that come with matplotlib. A character without a glyph in either would
stop the PDF and leave a hole in a figure; a box stands for it.
"""

from __future__ import annotations

import unicodedata
from functools import cache
from pathlib import Path

FAMILY = "Steadyhand Sans"
FALLBACK = "DejaVu Sans"
STAND_IN = "□"
FONTS = Path(__file__).parent / "fonts"
_INVISIBLE = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")  # controls, formats, halves of pairs, nothing, separators


def fallback_folder() -> Path:
    """The folder of the DejaVu fonts that come with matplotlib: Latin, Greek, Cyrillic, Arabic, Hebrew and symbols."""
    import matplotlib as mpl

    return Path(mpl.get_data_path()) / "fonts" / "ttf"


@cache
def _covered() -> frozenset[int]:
    from matplotlib.ft2font import FT2Font

    files = (FONTS / "SteadyhandSans-Regular.ttf", fallback_folder() / "DejaVuSans.ttf")
    return frozenset(character for file in files for character in FT2Font(str(file)).get_charmap())


def showable(text: str) -> str:
    """Text with □ for each character that has no glyph; line breaks become spaces."""
    return "".join(map(_shown, text))


@cache
def _shown(character: str) -> str:
    if character in "\n\r\t":
        return " "
    visible = unicodedata.category(character) not in _INVISIBLE
    return character if visible and ord(character) in _covered() else STAND_IN

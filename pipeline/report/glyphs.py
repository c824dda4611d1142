"""Characters that the bundled fonts can show.

A character without a glyph would stop the PDF and leave a hole in a figure; a box stands for it.
"""

from __future__ import annotations

import unicodedata
from functools import cache
from pathlib import Path

STAND_IN = "□"
_INVISIBLE = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")  # controls, formats, halves of pairs, nothing, separators


def font_folder() -> Path:
    """The folder of the DejaVu fonts that come with matplotlib: Latin, Greek, Cyrillic, Arabic, Hebrew and symbols."""
    import matplotlib as mpl

    return Path(mpl.get_data_path()) / "fonts" / "ttf"


@cache
def _covered() -> frozenset[int]:
    from matplotlib.ft2font import FT2Font

    return frozenset(FT2Font(str(font_folder() / "DejaVuSans.ttf")).get_charmap())


def showable(text: str) -> str:
    """Text with □ for each character that has no glyph; line breaks become spaces."""
    return "".join(_shown(c) for c in text)


def _shown(character: str) -> str:
    if character in "\n\r\t":
        return " "
    visible = unicodedata.category(character) not in _INVISIBLE
    return character if visible and ord(character) in _covered() else STAND_IN

"""What the bundled fonts can show. A character without a glyph would stop the PDF and leave a hole in a figure."""

from __future__ import annotations

from functools import cache
from pathlib import Path

STAND_IN = "□"


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
    known = _covered()
    return "".join(c if ord(c) in known and c.isprintable() else " " if c.isspace() else STAND_IN for c in text)

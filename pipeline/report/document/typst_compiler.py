"""The typst compiler as reports use it: it reads one folder of figures, and the fonts that come with the program."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.report.glyphs import FONTS, fallback_folder

if TYPE_CHECKING:
    import typst


def compiler_of(source: bytes, figures: Path, **inputs: str) -> typst.Compiler:
    """A compiler of `source`, whose `sys.inputs` are these; `figures` is the only folder that it can read."""
    import typst

    return typst.Compiler(
        source,
        root=figures.resolve(),
        font_paths=_fonts(),
        ignore_system_fonts=True,
        sys_inputs=inputs,
    )


@cache
def _fonts() -> typst.Fonts:
    """The program's fonts, looked through once: that takes longer than to typeset a small figure."""
    import typst

    return typst.Fonts(include_system_fonts=False, font_paths=[FONTS, fallback_folder()])

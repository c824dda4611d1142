"""Make the fonts of the reports from Source Sans 3 (Adobe, SIL Open Font License 1.1).

    npm pack source-sans@3.52.0 && tar xzf source-sans-3.52.0.tgz
    python tools/make_fonts.py package          # needs fonttools and brotli

Four styles as TTF for figures and PDF, and three as WOFF2 with the characters that a page mostly needs, small enough to
stand inside of each page. The licence reserves the name "Source" for the unchanged fonts, so these are called
Steadyhand Sans. Hinting and alternative glyphs are left out; digits are as wide as one another where asked for.
"""

from __future__ import annotations

import sys
from pathlib import Path

from fontTools import subset
from fontTools.ttLib import TTFont

FAMILY = "Steadyhand Sans"
FOLDER = Path(__file__).parents[1] / "pipeline" / "report" / "fonts"
STYLES = {"Regular": "Regular", "It": "Italic", "Semibold": "Semibold", "SemiboldIt": "SemiboldItalic"}
_FEATURES = ("ccmp", "kern", "liga", "locl", "mark", "mkmk", "tnum")
_SYMBOLS = (range(0x2010, 0x2200), range(0x2200, 0x2300), range(0x25A0, 0x2610), range(0x2713, 0x2718))
_GREEK = range(0x370, 0x400)
# Names of people and places may hold any Latin letter; italics are set of symbols only.
PAGES = {
    "Regular": (range(0x20, 0x180), _GREEK, *_SYMBOLS),
    "Semibold": (range(0x20, 0x180), _GREEK, *_SYMBOLS),
    "It": (range(0x20, 0x7F), _GREEK, (0xB2, 0x2212)),
}


def make(package: Path) -> None:
    """Write all of them from the package's folder."""
    FOLDER.mkdir(exist_ok=True)
    for style, name in STYLES.items():
        _write(package, style, f"{name}.ttf", None)
    for style, ranges in PAGES.items():
        _write(package, style, f"{STYLES[style]}.woff2", {code for codes in ranges for code in codes})
    (FOLDER / "LICENSE.md").write_text((package / "LICENSE.md").read_text(encoding="utf-8"), encoding="utf-8")


def _write(package: Path, style: str, file: str, wanted: set[int] | None) -> None:
    font = TTFont(package / "TTF" / f"SourceSans3-{style}.ttf", recalcTimestamp=False)
    options = subset.Options(hinting=False, layout_features=[*_FEATURES], name_IDs=["*"], notdef_outline=True)
    subsetter = subset.Subsetter(options)
    subsetter.populate(unicodes=set(font.getBestCmap()) & wanted if wanted else set(font.getBestCmap()))
    subsetter.subset(font)
    _rename(font, STYLES[style])
    font.flavor = "woff2" if file.endswith(".woff2") else None
    font.save(FOLDER / f"SteadyhandSans-{file}")


def _rename(font: TTFont, style: str) -> None:
    """Call the font by its new name wherever it says its own; who drew it, and under which licence, stays."""
    spoken = style.replace("boldItalic", "bold Italic")
    plain = style in ("Regular", "Italic")
    names = {
        1: FAMILY if plain else f"{FAMILY} Semibold",
        2: style if plain else ("Italic" if style.endswith("Italic") else "Regular"),
        3: f"{FAMILY} {spoken}, after Source Sans 3",
        4: f"{FAMILY} {spoken}",
        6: f"{FAMILY.replace(' ', '')}-{style}",
        16: FAMILY,
        17: spoken,
    }
    table = font["name"]
    for record in list(table.names):
        if record.nameID in names:
            table.setName(names[record.nameID], record.nameID, record.platformID, record.platEncID, record.langID)
        elif record.nameID not in (0, 5, 7, 8, 9, 11, 12, 13, 14):
            table.removeNames(record.nameID, record.platformID, record.platEncID, record.langID)


if __name__ == "__main__":
    make(Path(sys.argv[1]))

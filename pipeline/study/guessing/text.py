"""How a CSV file was probably written: its encoding, the separator of its cells, and the mark before the decimals."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Iterable

_BOMS = {
    codecs.BOM_UTF8: "utf-8",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
_CP1252_MARKS = frozenset(
    b"\x80\x82\x84\x85\x91\x92\x93\x94\x95\x96\x97\x99"
)  # € quotes dashes, common in Windows text
_SEPARATORS = {";": 1.0, "\t": 1.0, "|": 1.0, ",": 0.5, " ": 0.25}
_SAMPLE_LINES = 50
_SHARE_OF_LINES = 0.9
_COMMA_NUMBER = re.compile(r"[-+−]?\d+,\d+(?:[eE][-+]?\d+)?")
_POINT_NUMBER = re.compile(r"[-+−]?\d+\.\d+(?:[eE][-+]?\d+)?")
_SHOWN = 30


def encoding_of(content: bytes) -> str:
    """The encoding that a file's bytes probably are in, by the name that Python has for it.

    What is not Unicode is from Windows (cp1252), or from an old Mac if most of its letters would be none in cp1252: ü,
    ö, ä and é are 0x80 to 0x9f there, and 0xc0 to 0xff on Windows.
    """
    for mark, name in _BOMS.items():
        if content.startswith(mark):
            return name
    if content.count(b"\0") > len(content) // 4:
        return "utf-16-le" if content[1:2] == b"\0" else "utf-16-be"
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        windows = sum(byte >= 0xC0 for byte in content)
        mac = sum(0x80 <= byte < 0xA0 and byte not in _CP1252_MARKS for byte in content)
        return "mac_roman" if mac > windows else "cp1252"
    return "utf-8"


def encoding_remedy(content: bytes, stated: str, error: UnicodeError) -> str:
    """What to write into study.yaml for a file that is not in the encoding stated, with a word that shows it."""
    probably = encoding_of(content)
    at = error.start if isinstance(error, UnicodeDecodeError) else 0
    line = content[:at].count(b"\n") + 1
    if probably == stated:
        return f"row {line}: is not text in {stated} ({error}); save the file as CSV in UTF-8"
    text = content.decode(probably, errors="replace")
    row = text.splitlines()[min(line, len(text.splitlines())) - 1] if text else ""
    word = next((cell for cell in re.split(r"[;,\t|]", row) if not cell.isascii()), row)[:_SHOWN].strip()
    return (
        f'row {line}: is not in {stated.upper()}; in {probably} it reads "{word}". If that is right, write format:'
        f" {{encoding: {probably}}} in study.yaml"
    )


def separator_of(text: str) -> str:
    """The character that separates a file's cells: the one that cuts lines into the same number of them, and many.

    A comma counts less than a semicolon, for it may stand before decimals, and a space less still.
    """
    lines = [line for line in text.splitlines()[: _SAMPLE_LINES + 1] if line.strip()]
    scores: dict[str, float] = {}
    for separator, weight in _SEPARATORS.items():
        cells = [len(row) for row in csv.reader(io.StringIO("\n".join(lines)), delimiter=separator)]
        usual = max(set(cells), key=lambda count: (cells.count(count), count), default=1)
        if usual > 1 and cells.count(usual) >= _SHARE_OF_LINES * len(cells):
            scores[separator] = usual * weight
    return max(scores, key=lambda separator: scores[separator], default=",")


def decimal_of(cells: Iterable[str]) -> str:
    """The mark before the decimals of a table's numbers: a comma if more cells are written so than with a point."""
    commas = points = 0
    for cell in cells:
        commas += _COMMA_NUMBER.fullmatch(cell.strip()) is not None
        points += _POINT_NUMBER.fullmatch(cell.strip()) is not None
    return "," if commas > points else "."

"""Numbers and words in a column that probably stand for a missing value."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pipeline.statistics.arrays import FloatArray

_CODES = (-9.0, -99.0, -999.0, -9999.0, 99.0, 999.0, 9999.0)
_FAR = 3.0  # times the largest of the others: a code, not a slow participant
_OTHERS_MIN = 3
_WORDS_MAX = 2  # different words in one column: more of them are no codes


def missing_codes(value: FloatArray) -> list[float]:
    """−99, 999 and their like among the values (n,), where all others are far from them."""
    return [code for code in _CODES if _stands_out(value, code)]


def _stands_out(value: FloatArray, code: float) -> bool:
    """Is the code among the values, and nothing else like it?"""
    rest = value[~np.isin(value, _CODES)]
    if not np.any(value == code) or len(rest) < _OTHERS_MIN:
        return False
    if code < 0:
        return bool(rest.min() >= 0 or (code <= -99.0 and rest.min() > code / _FAR))
    return bool(rest.max() * _FAR < code and rest.min() >= 0)


def number_of(cell: str, decimal: str) -> float | None:
    """A cell as a number; None where it is none, or has the other mark before its decimals."""
    text = cell.strip().replace("−", "-")
    if decimal == ",":
        text = text.replace(".", "?").replace(",", ".")
    try:
        return None if "_" in text or not text[-1:].isdigit() else float(text)
    except ValueError:
        return None


def missing_words(columns: Sequence[Sequence[str]], decimal: str, known: Sequence[str]) -> Iterator[str]:
    """Words in columns of numbers that probably stand for a missing value; those that are `known` always do."""
    for cells in columns:
        words = list(dict.fromkeys(cell for cell in cells if cell not in known and number_of(cell, decimal) is None))
        if len(words) <= _WORDS_MAX:
            yield from words

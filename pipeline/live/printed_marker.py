"""A marker as a page to print, true to size: black squares as vectors, a ruler to check the print, and what to do."""

from __future__ import annotations

import json
from pathlib import Path

_HERE = Path(__file__).parent
_DICTIONARY = bytes.fromhex("""
b532 0f9a 332d 9946 549e 79cd 9e2e c4f2 feda cf56 f991 11a7 0eb7 2a0f 24b1 263e 4665
6600 6c5e 76af 868b b02b ccd5 dd82 fe47 9471 ace4 a554 2123 346f 4415 57b2 9ecf f0cb
08ae 0929 1875 04ff 0df6 1c5a 1718 2a28 328c 38b2 24e8 2eeb 2d3f 4b64 502e 5013
""")
"""OpenCV's DICT_4X4_50: two bytes a marker, its bits row by row from the top left, 1 for white."""
COUNT = len(_DICTIONARY) // 2
CELLS = 6
"""On a side, with the black ones around."""
SMALLEST_MM, LARGEST_MM = 10.0, 120.0
_LEAST_BORDER_MM = 10.0


def cells(number: int) -> tuple[tuple[bool, ...], ...]:
    """The cells of a marker, 6 × 6, row by row: whether each is black."""
    bits = f"{int.from_bytes(_DICTIONARY[2 * number : 2 * number + 2]):016b}"
    edge, inside = (True,) * CELLS, [bits[row : row + 4] for row in range(0, 16, 4)]
    return (edge, *((True, *(bit == "0" for bit in row), True) for row in inside), edge)


def write(number: int, size_mm: float, path: Path) -> None:
    """Write the page as a PDF; the black square is `size_mm` wide. OSError where it cannot be written."""
    from pipeline.report.document.typst_compiler import compiler_of

    source = (_HERE / "marker.typ").read_bytes()
    compiler = compiler_of(source, _HERE, marker=json.dumps(_content(number, size_mm), ensure_ascii=False))
    pdf = compiler.compile(format="pdf", pdf_standards=["ua-1", "a-2a"], timestamp=0)
    assert isinstance(pdf, bytes)  # noqa: S101 - one document gives one PDF
    path.write_bytes(pdf)


def _content(number: int, size_mm: float) -> dict[str, object]:
    border_mm = max(size_mm / 4, _LEAST_BORDER_MM)
    return {
        "title": f"Marker {number}, {size_mm:g} mm",
        "size_mm": size_mm,
        "border_mm": border_mm,
        "cells": cells(number),
        "alt": f"ArUco marker {number} of the dictionary 4X4_50, {size_mm:g} mm wide",
        "ruler": "This ruler is 100 mm long.",
        "steps": [
            "Print this page at 100 % (“actual size”, not “fit to page”), black on white, on matt paper.",
            "Measure the ruler. If it is not 100 mm long, print again at the right size, or measure the black square"
            " and write its width as marker_mm.",
            f"Cut along the dashed line: the marker needs the white border, {border_mm:g} mm on each side.",
            "Glue it flat on cardboard. Bent paper moves the position.",
            "Hold or fasten it where the hand's position is to be measured, its face to the camera. Which way up makes"
            " no difference.",
            f"In study.yaml: camera: {{marker: {number}, marker_mm: {size_mm:g}}}",
        ],
    }

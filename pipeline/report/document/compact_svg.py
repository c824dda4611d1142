"""A figure for a page with fewer characters: it looks the same, and its file beside the page stays as it was drawn."""

from __future__ import annotations

import re

_HEAD = re.compile(r"<\?xml.*?\?>\s*<!DOCTYPE.*?>\s*|<metadata>.*?</metadata>|<!--.*?-->|<title>.*?</title>", re.DOTALL)
_INDENT = re.compile(r"\s*\n\s*")
_PLACES = re.compile(r'(?<= )(?:d|x|y|points)="[^"]*"')
_DECIMALS = re.compile(r"-?\d+\.\d{3,}")
_ALIKE = re.compile(
    r'<g( clip-path="[^"]*")?>((?:\n<use xlink:href="[^"]*" x="[^"]*" y="[^"]*" (style="[^"]*")/>){2,})\n</g>'
)
_EMPTY = re.compile(r"></use>")


def compact(svg: str) -> str:
    """Coordinates to a hundredth of a point; what many marks share is said once; no indents, no words about the file.

    Titles go too: a page shows a figure as an image, in which nothing can be pointed at.
    """
    plain = _EMPTY.sub("/>", _HEAD.sub("", svg))
    plain = _INDENT.sub("\n", plain)
    plain = _PLACES.sub(lambda places: _DECIMALS.sub(_rounded, places.group()), plain)
    return _ALIKE.sub(_said_once, plain)


def _rounded(number: re.Match[str]) -> str:
    return f"{float(number.group()):.2f}".rstrip("0").rstrip(".")


def _said_once(group: re.Match[str]) -> str:
    """The marks of a group under one style, where it is the same of all."""
    clip, marks, style = group.group(1) or "", group.group(2), group.group(3)
    if marks.count(style) != marks.count("<use "):
        return group.group()
    return f"<g{clip} {style}>{marks.replace(f' {style}/>', '/>')}\n</g>"

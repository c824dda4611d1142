"""A page taken apart: what it refers to, runs and says."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path

from pipeline.report.document import html


class Checker(HTMLParser):
    """What a page refers to, runs and says, and whether its pictures are named."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.references: list[str] = []
        self.handlers: list[str] = []
        self.pictures_without_alt = 0
        self.text: list[str] = []
        self.scripts: list[str] = []
        self._inside = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self._inside = tag
        named = dict(attrs)
        self.references += [value or "" for key, value in attrs if key in ("src", "href")]
        self.handlers += [key for key, _ in attrs if key.startswith("on")]
        if tag == "img" and not named.get("alt"):
            self.pictures_without_alt += 1
        if tag == "script":
            self.scripts.append("")

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def handle_data(self, data: str) -> None:
        if self._inside == "script":
            self.scripts[-1] += data
        elif self._inside != "style":
            self.text.append(data)


def checked(page: str) -> Checker:
    checker = Checker()
    checker.feed(page)
    return checker


def script(name: str) -> str:
    """A script of the program's own."""
    return (Path(html.__file__).parent / name).read_text(encoding="utf-8")

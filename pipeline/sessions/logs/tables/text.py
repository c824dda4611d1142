"""A table's text: its encoding, its first lines, and what separates its cells."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import SessionError
from pipeline.sessions.logs.log import Limits

_SEPARATORS = ",;\t"
_HEAD_LINES = 60
_HEAD_BYTES = 2**16


@dataclass(frozen=True)
class Text:
    """A file's text in UTF-8, its lines ended by "\\n" alone, and its first lines."""

    whole: bytes
    head: tuple[str, ...]

    def below(self, lines: int) -> memoryview:
        """What stands below the first lines, not copied."""
        begin = 0
        for _ in range(lines):
            begin = self.whole.find(b"\n", begin) + 1
            if not begin:
                return memoryview(b"")
        return memoryview(self.whole)[begin:]


def read_text(path: Path, limits: Limits) -> Text:
    """A file's text. SessionError for one that is empty, no text, a Git LFS pointer or larger than the limit."""
    size = path.stat().st_size
    if size > limits.unpacked_bytes:
        raise SessionError(
            f"refused: a table of {size // 2**20} MiB; if it is sound, write `log_limits: {{unpacked_mib: N}}` in "
            "study.yaml"
        )
    content = path.read_bytes()
    if content.startswith(b"version https://git-lfs.github.com/spec/"):
        raise SessionError("it is a Git LFS pointer, not the log itself; run: git lfs pull")
    whole = _in_utf8(content)
    if b"\0" in whole:
        raise SessionError("it is no text")
    if not whole or whole.isspace():
        raise SessionError("the file is empty")
    if b"\r" in whole:
        whole = whole.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    head = whole[:_HEAD_BYTES].decode(errors="replace").removesuffix("\n").split("\n")
    return Text(whole, tuple(head[:_HEAD_LINES]))


def _in_utf8(content: bytes) -> bytes:
    """The bytes in UTF-8 without a mark at their begin; what is neither UTF-8 nor UTF-16 is taken for Windows text."""
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", errors="replace").encode()
    try:
        content.decode()
    except UnicodeDecodeError:
        head, rest = content[:_HEAD_BYTES], content[_HEAD_BYTES:]  # often only names of columns have other letters
        return _from_windows(head) + (rest if rest.isascii() else _from_windows(rest))
    return content.removeprefix(b"\xef\xbb\xbf")


def _from_windows(content: bytes) -> bytes:
    return content.decode("cp1252", errors="replace").encode()


def separator_of(line: str) -> str:
    """The separator that a header has most of; a space where it has none."""
    most = max(_SEPARATORS, key=line.count)
    return most if most in line else " "


def split_line(line: str, separator: str) -> list[str]:
    """The cells of one line, without the quotes around them."""
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]

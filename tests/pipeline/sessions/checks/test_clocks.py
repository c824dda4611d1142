"""By how much clocks differ, in words that hint at the cause."""

from __future__ import annotations

import pytest

from pipeline.sessions.checks.clocks import offset_in_words


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (4.2, "4.2 s"),
        (7205.0, "2 h, as by a time zone or summer time"),
        (4000.0, "1.1 h"),
        (1.7e9, "53.9 years, as where one counts since 1970 and the other from its start"),
    ],
)
def test_an_offset_hints_at_its_cause(seconds: float, words: str) -> None:
    assert offset_in_words(seconds) == words

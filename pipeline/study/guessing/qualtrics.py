"""Exports of Qualtrics: how many rows their header has, and which of their columns are Qualtrics's own.

Below the names of the columns stand the questions' texts, and in exports since 2016 a row of {"ImportId": …} below
these. Then the answers come, those of the preview among them.
"""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.study.guessing.headers import plain

_WORDS = """
    startdate enddate status ipaddress progress durationinseconds finished recordeddate responseid
    recipientlastname recipientfirstname recipientemail externalreference externaldatareference locationlatitude
    locationlongitude distributionchannel userlanguage
    """
_OWN = frozenset(_WORDS.split())
_IMPORT_ID = '"ImportId"'
_OWN_MIN = 3
_PERSON = "responseid"


def header_rows(rows: Sequence[Sequence[str]]) -> int:
    """How many of the first rows are the header of an export of Qualtrics; 1 for any other table."""
    if sum(is_own(name) for name in rows[0]) < _OWN_MIN:
        return 1
    for place, row in enumerate(rows[1:3], start=2):
        if any(_IMPORT_ID in cell for cell in row):
            return place
    # Older exports have the questions' texts alone, which say "Start Date" above the dates.
    dated = [place for place, name in enumerate(rows[0]) if plain(name) in ("startdate", "enddate")]
    words = [rows[1][place] for place in dated if len(rows) > 1 and place < len(rows[1])]
    return 2 if words and not any(character.isdigit() for word in words for character in word) else 1


def is_own(header: str) -> bool:
    """Whether a column is about the answering itself, and no answer."""
    return plain(header) in _OWN


def person_of(headers: Sequence[str]) -> str | None:
    """The column that tells answers apart where no other names the participants."""
    return next((name for name in headers if plain(name) == _PERSON), None)


def looks_like_header(texts: Sequence[str]) -> bool:
    """Whether cells in the place of numbers are such as stand in the further rows of a header."""
    return any(_IMPORT_ID in text for text in texts)

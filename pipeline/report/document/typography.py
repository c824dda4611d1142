"""Symbols of statistics as papers print them: italic letters, true subscripts, and no line break within a figure.

Words come as plain text ("t(11) = 2.52, p = .0286, d_z = 0.73"), the same that is said on the console. What is set
otherwise is found here, by the few forms that statistics have (APA 7, 6.44), and by nothing that only looks like them:
a letter counts where a value or degrees of freedom follow it, and p, W₊, "t test" and "n:" also in words.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

Style = Literal["", "italic", "subscript"]

_LETTER = r"SD|[FtpnMNWHUQVzrR]"
_NO_BREAK = "\u00a0"
_FREEDOM = rf"\(\d[\d., {_NO_BREAK}]*\)"  # of a test, after its letter
_RELATION = re.compile(
    rf"(?<![\w-])((?:{_LETTER}|[χηωε]²?[Gp]?|df|estimate|ratio|BF₁₀|[dr]_[a-z]+)₊?(?:{_FREEDOM})?) ([=<>≥≤]) (?=[−.\d])"
)
_UNIT = re.compile(r"(?<=\d) (?=(?:%|mm|cm|px|ms|s|Hz)(?!\w))")
_ALONE = re.compile(r"^([<>]) (?=\.\d)")  # `< .0001` in a cell
_INTERVAL = re.compile(r"\[[−+]?[\d.][^][, ]*, [−+]?[\d.][^][, ]*\]")  # both bounds stay on one line
_P_IN_WORDS = (  # not every p, which may be somebody's name of something
    r"p(?= values?\b| adjusted\b| corrected\b| made\b| \((?:Holm|[A-Z])|: (?:not )?adjusted)"
    r"|p(?= [\w-]+-adjusted| was corrected| of W\b| of the effect|, (?:Greenhouse|Huynh)| need not agree)"
    r"|(?<=adjusted )p(?!\w)|(?<=corrected )p(?!\w)|(?<=Geisser )p(?!\w)|(?<=small )p(?!\w)|(?<=Wilk's )p(?!\w)"
    r"|(?<=Mauchly's )p(?!\w)"
    r"|(?<=The )p(?= below)|(?<=\. )p(?= is the probability)|(?<=: )p(?= of \d)"
)
_SYMBOL = re.compile(
    rf"(?<![\w-])(?P<letter>{_LETTER})(?=₊?{_FREEDOM}[ {_NO_BREAK}][=<>]|₊?{_NO_BREAK}[=<>≥≤])"
    r"|(?<![\w-])(?P<effect>[dr])_(?P<of>rb|rm|av|z|s)(?!\w)"
    r"|(?P<share>[ηω])(?P<squared>²)_?(?P<kind>[Gp])(?!\w)"
    rf"|(?<![\w-])(?P<alone>{_P_IN_WORDS}|W₊|t(?= tests?\b| intervals?\b)|n(?=: \w))"
)
_HEADINGS = frozenset(("n", "p", "W", "SD", "df", "M"))


@dataclass(frozen=True)
class Run:
    """Words that are set in one way."""

    text: str
    style: Style = ""


@lru_cache(maxsize=4096)
def typeset(text: str) -> tuple[Run, ...]:
    """A text in runs. Joined they are the text, but for the underscores of subscripts and for spaces of no break."""
    kept_together = _UNIT.sub(_NO_BREAK, _RELATION.sub(lambda said: said[0].replace(" ", _NO_BREAK), text))
    kept_together = _ALONE.sub(rf"\1{_NO_BREAK}", kept_together)
    kept_together = _INTERVAL.sub(lambda bounds: bounds[0].replace(" ", _NO_BREAK), kept_together)
    return tuple(run for run in _runs(kept_together) if run.text)


def _runs(text: str) -> Iterator[Run]:
    done = 0
    for match in _SYMBOL.finditer(text):
        yield Run(text[done : match.start()])
        if match["alone"]:
            yield Run(match["alone"][0], "italic")
            yield Run(match["alone"][1:])
        elif match["letter"]:
            yield Run(match["letter"], "italic")
        elif match["effect"]:
            yield Run(match["effect"], "italic")
            yield Run(match["of"], "subscript")
        else:
            yield Run(match["share"], "italic")
            yield Run(match["squared"])
            yield Run(match["kind"], "subscript")
        done = match.end()
    yield Run(text[done:])


def typeset_heading(text: str) -> tuple[Run, ...]:
    """As `typeset`, of a table's column, where a symbol stands alone."""
    return (Run(text, "italic"),) if text in _HEADINGS else typeset(text)

"""The result of a check of printed figures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["agreement", "remark", "contradiction", "cannot be checked"]

AGREEMENT: Verdict = "agreement"
REMARK: Verdict = "remark"
CONTRADICTION: Verdict = "contradiction"
UNCHECKED: Verdict = "cannot be checked"

VERDICTS: tuple[Verdict, ...] = (CONTRADICTION, REMARK, UNCHECKED, AGREEMENT)
"""From the gravest to the lightest."""


@dataclass(frozen=True)
class Finding:
    """One check of one statement.

    `printed` is what the publication says and `follows` what its other figures leave room for. A *contradiction*
    cannot be true together with them; a *remark* can, and a reader should know of it.
    """

    check: str
    what: str
    printed: str
    follows: str
    verdict: Verdict
    explanation: str


@dataclass(frozen=True)
class Statement:
    """What a check is about, before it is made."""

    check: str
    what: str
    printed: str

    def judge(self, fits: bool, follows: str, explanation: str) -> Finding:
        """An agreement where the figures fit, else a contradiction."""
        return self._finding(AGREEMENT if fits else CONTRADICTION, follows, explanation)

    def remark(self, follows: str, explanation: str) -> Finding:
        """Possible, and worth knowing of."""
        return self._finding(REMARK, follows, explanation)

    def unchecked(self, reason: str) -> Finding:
        """A check that could not be made."""
        return self._finding(UNCHECKED, "", reason)

    def _finding(self, verdict: Verdict, follows: str, explanation: str) -> Finding:
        return Finding(self.check, self.what, self.printed, follows, verdict, explanation)

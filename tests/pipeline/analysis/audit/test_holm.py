"""Whether significance survives an adjustment that a text does not make, where rounding leaves that open."""

from __future__ import annotations

import pytest

from pipeline.analysis.audit.audit import audit
from pipeline.analysis.audit.finding import AGREEMENT, REMARK
from pipeline.study.printed import Publication


@pytest.mark.parametrize(
    ("smaller", "verdict", "follows"),
    [
        (".024", AGREEMENT, "2 after Holm"),  # doubled .047 to .049
        (".025", AGREEMENT, "2 after Holm"),  # .049 to .051: it may be below .05
        (".026", REMARK, "0 of 2 after Holm"),  # .051 to .053
    ],
)
def test_what_may_be_significant_after_holm_is_not_called_lost(smaller: str, verdict: str, follows: str) -> None:
    """Of two p the smaller counts twice, and the larger, here .03, is no less than that."""
    measures = [{"name": f"m {p}", "tests": [{"p": p, "significant": True}]} for p in (smaller, ".030")]
    content = {"source": "a paper", "measures": measures, "families": [{"label": "f", "measures": "m *"}]}
    (found,) = (one for one in audit(Publication.model_validate(content)) if one.check == "multiplicity")
    assert (found.verdict, found.follows) == (verdict, follows)

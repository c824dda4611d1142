"""Figures printed by a convention of their own: one-sided p, and SDs whose divisor is n."""

from __future__ import annotations

import pytest

from pipeline.analysis.audit.audit import audit
from pipeline.analysis.audit.finding import AGREEMENT, CONTRADICTION, REMARK, Finding
from pipeline.study.printed import Publication


def found(check: str, test: dict[str, object], **rest: object) -> Finding:
    """The finding of one check of a measure with one printed test and, of two groups of nine, means and SDs."""
    cells = {name: {"n": 9, "mean": mean, "sd": "3.00"} for name, mean in (("a", "7.00"), ("b", "5.00"))}
    content = {"source": "a paper", "measures": [{"name": "m", "cells": cells, "tests": [test]}], **rest}
    (finding,) = (finding for finding in audit(Publication.model_validate(content)) if finding.check == check)
    return finding


@pytest.mark.parametrize(
    ("p", "unsaid", "one_sided"),
    [
        (".317", AGREEMENT, CONTRADICTION),
        (".159", REMARK, AGREEMENT),
        (".841", REMARK, AGREEMENT),  # against the direction found: all but the tail beyond z
        (".683", CONTRADICTION, CONTRADICTION),  # between −z and z, which is no p
    ],
)
def test_a_normal_of_1_has_its_tails_by_the_table(p: str, unsaid: str, one_sided: str) -> None:
    """Φ(1) = .8413, as every table of the normal distribution prints it."""
    assert found("recomputed p", {"z": "1.00", "p": p}).verdict == unsaid
    assert found("recomputed p", {"z": "1.00", "p": p, "sides": "1"}).verdict == one_sided


@pytest.mark.parametrize("test", ["t_independent", "welch"])
@pytest.mark.parametrize(("divisor", "t"), [("population", "1.33"), ("sample", "1.41")])
def test_t_of_sds_divided_by_n(test: str, divisor: str, t: str) -> None:
    """With n − 1: 2 / (3 · √(2/9)) = 1.414; with n the samples' SD is 3 · √(9/8), and t is 2 / 1.5 = 1.333."""
    printed: dict[str, object] = {"test": test, "conditions": ["a", "b"], "t": t, "df": "16"}
    for sd in ("population", "sample"):
        wanted = AGREEMENT if sd == divisor else CONTRADICTION
        assert found("statistic from means", printed, sd=sd).verdict == wanted

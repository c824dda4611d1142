"""The block `preregistration:` of study.yaml: what a preregistration asks and no other key says."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pipeline.study.fields import Frozen

_Answer = Annotated[str, Field(min_length=1)] | None


class Preregistration(Frozen):
    """Answers in the study's own words; what is left out is "not stated" on the page.

    `participants` is how many are planned in all, `seed` that of `steadyhand plan`.
    """

    question: _Answer = None
    data_collected: _Answer = None
    participants: Annotated[int, Field(ge=2, le=100_000)] | None = None
    sample_size_rationale: _Answer = None
    stopping_rule: _Answer = None
    seed: Annotated[int, Field(ge=0)] | None = None
    blinding: _Answer = None
    procedure: _Answer = None
    exclusion_rules: _Answer = None
    outlier_rules: _Answer = None
    exploratory: _Answer = None
    other: _Answer = None

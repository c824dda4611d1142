"""Which questionnaires have a total: those whose authors report a sum, and none that has a scale of that name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from tests.pipeline.helpers import Steadyhand

Folder = Callable[..., Path]


def means(folder: Folder, steadyhand: Steadyhand, questionnaire: str, scales: dict[str, int]) -> dict[str, float]:
    """What two people who rate alike are described by in condition a."""
    rows = [
        f"{person},{condition},{questionnaire},{scale},{rating}"
        for person in ("P1", "P2")
        for condition in "ab"
        for scale, rating in scales.items()
    ]
    table = "\n".join(["participant,condition,questionnaire,scale,rating", *rows]) + "\n"
    study = folder("conditions: [a, b]\nquestionnaires: q.csv\n", **{"q.csv": table})
    ran = steadyhand("compare", study)
    assert ran.code == 0, ran.err
    return {row["measure"]: row["mean"] for row in steadyhand.results()["descriptives"] if row["condition"] == "a"}


def test_the_scales_of_the_ueq_are_never_added_up(folder: Folder, steadyhand: Steadyhand) -> None:
    """Its handbook says that there is no overall score."""
    found = means(folder, steadyhand, "ueq", {"efficiency": 2, "novelty": 1})
    assert found == {"ueq/efficiency": 2, "ueq/novelty": 1}


def test_the_scales_of_nasa_tlx_are(folder: Folder, steadyhand: Steadyhand) -> None:
    found = means(folder, steadyhand, "nasa_tlx", {"mental": 7, "effort": 4})
    assert found == {"nasa_tlx/mental": 7, "nasa_tlx/effort": 4, "nasa_tlx/total": 11}


def test_a_total_that_a_table_brings_is_the_total(folder: Folder, steadyhand: Steadyhand) -> None:
    found = means(folder, steadyhand, "nasa_tlx", {"mental": 7, "effort": 4, "total": 12})
    assert found == {"nasa_tlx/mental": 7, "nasa_tlx/effort": 4, "nasa_tlx/total": 12}

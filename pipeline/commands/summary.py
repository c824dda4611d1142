"""The few lines a terminal shows of a study's results."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pipeline.analysis.audit.finding import CONTRADICTION
from pipeline.words import comparison_sentence, counted, measure_label, number


def summary(results: Mapping[str, Any]) -> Iterator[str]:
    """Title and origin, then every comparison, and each estimator's mean error."""
    study = results["study"]
    yield f"{study['title']} (data: {study['data_origin']})"
    rows = results["comparisons"]
    if len(study["conditions"]) > 2:  # pairs are many; the page lists them
        rows = [row for row in rows if row["contrast"] is None]
    for row in rows:
        yield f"  {measure_label(row['measure'])}: {comparison_sentence(row)}"
    if len(rows) < len(results["comparisons"]):
        yield f"  {len(results['comparisons']) - len(rows)} pairwise comparisons: see the report"
    for row in results["accuracy_means"]:
        yield f"  {row['estimator']}: RMSE {number(row['rmse_mm'])} mm (mean of {counted(row['n'], 'session')})"
    figures = [row for row in results["printed"] if row["check"] is None]
    if figures:
        agreeing = sum(row["verdict"] == "agrees" for row in figures)
        yield f"  printed figures reproduced to the digit: {agreeing}; not: {len(figures) - agreeing}"
    for row in figures:
        if row["verdict"] == "differs":
            yield f"    {row['what']}: printed {row['printed']}, computed {row['computed']}"
    contradictions = [row for row in results["printed"] if row["verdict"] == CONTRADICTION]
    if contradictions:
        yield f"  printed figures that contradict others of the publication: {len(contradictions)}"
    for row in contradictions:
        yield f"    {row['what']}: {row['printed']}; {row['explanation']}"

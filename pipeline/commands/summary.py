"""The few lines that the console shows of a study's results."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pipeline.analysis.audit.finding import CONTRADICTION
from pipeline.commands import console
from pipeline.report.prose.accuracy_claims import sessions_in_doubt, without_reference
from pipeline.report.prose.answer import HEADER, answer, notes, rows_beside_the_answer
from pipeline.words.names import measure_label
from pipeline.words.numbers import number
from pipeline.words.phrases import counted, one_line
from pipeline.words.sentences import brief_sentence

_CHECKS_MAX = 5  # printed; the report has them all


def say_results(results: Mapping[str, Any]) -> None:
    """Print title and origin, the table of pairs as on the report's first page, and the lines of `summary`."""
    study = results["study"]
    console.say(one_line(f"{study['title']} (data: {study['data_origin']})"))
    lines = answer(results)
    if lines:
        significant = {at for at, line in enumerate(lines) if line.significant}
        console.table(HEADER, [line.cells for line in lines], left=4, strong=significant)
        console.say(f"  {notes(results)}")
    for line in summary(results):
        console.say(one_line(line))


def summary(results: Mapping[str, Any]) -> Iterator[str]:
    """The lines below the table of pairs: other tests, checks, accuracy, and printed figures."""
    for row in rows_beside_the_answer(results):
        yield f"  {measure_label(row['measure'])}: {brief_sentence(row)}"
    yield from _checks(results)
    yield from _accuracy(results)
    figures = [row for row in results["printed"] if row["check"] is None]
    if figures:
        agreeing = sum(row["verdict"] == "agrees" for row in figures)
        yield f"  printed figures reproduced exactly: {agreeing}; not: {len(figures) - agreeing}"
    for row in figures:
        if row["verdict"] == "differs":
            yield f"    {row['what']}: printed {row['printed']}, computed {row['computed']}"
    contradictions = [row for row in results["printed"] if row["verdict"] == CONTRADICTION]
    if contradictions:
        yield f"  printed figures that contradict others of the publication: {len(contradictions)}"
    for row in contradictions:
        yield f"    {row['what']}: {row['printed']}; {row['explanation']}"


def _checks(results: Mapping[str, Any]) -> Iterator[str]:
    """What is red, and what looks wrong in the study's own tables."""
    rows = [row for row in results["checks"] if row["status"] == "red" or (row["message"] and not row["session"])]
    for row in rows[:_CHECKS_MAX]:
        yield f"  {row['status']}: {row['session'] or 'tables'}: {row['check']}: {row['message']}"
    if len(rows) > _CHECKS_MAX:
        yield f"  {len(rows) - _CHECKS_MAX} more of these: see the table of checks in the report"


def _accuracy(results: Mapping[str, Any]) -> Iterator[str]:
    """Each estimator's mean error, and why none is the best where that cannot be said."""
    known = not without_reference(results)
    if not known:
        yield "  No reference was recorded: absolute error and lag cannot be known, nor which estimator is best."
    red, rated = sessions_in_doubt(results)
    if red:
        yield f"  {len(red)} of {counted(rated, 'session')} with a red check, so no estimator is called best"
    for row in results["accuracy_means"]:
        what = "RMSE {} mm" if known else "{} mm RMS from the smoothed readings"
        yield f"  {row['estimator']}: {what.format(number(row['rmse_mm']))} (mean of {counted(row['n'], 'session')})"

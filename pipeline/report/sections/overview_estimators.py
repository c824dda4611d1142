"""What the first page says of the estimators: which comes closest to the reference, or why that is not known."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from pipeline.report import figures
from pipeline.report.document.model import Figure, KeyFigure, Strong, Text
from pipeline.report.prose.accuracy_claims import without_reference
from pipeline.report.sections.cautions import NO_REFERENCE, contradicted, not_ranked
from pipeline.report.sections.material import Material
from pipeline.words.numbers import number
from pipeline.words.phrases import counted, listing

_NAMED = 2  # estimators in the answer; the table of accuracy has all
KEY_FIGURES_MAX = 3


def answer(material: Material) -> Text:
    """The estimator with the smallest mean error and the one after it, with their range over sessions.

    Without a reference nobody knows which is closest to the hand.
    """
    if without_reference(material.results):
        return (Strong(NO_REFERENCE), f" {_distances(material)}")
    unsure = contradicted(material)
    if unsure and material.rows("accuracy_means"):
        return (Strong(unsure), f" {_distances(material)}")
    errors = [_error_with_range(material, *mean) for mean in _mean_errors(material).items()]
    if not errors:
        return ()
    (best, error), *others = errors[:_NAMED]
    lead = f"{best} comes closest to the reference: its root mean square error (RMSE) is {error}."
    return (Strong(lead), *(f" Next is {name} with {error}." for name, error in others))


def _error_with_range(material: Material, estimator: str, mean_and_n: tuple[float, int]) -> tuple[str, str]:
    """The estimator's name, and `6.1 mm on average over 12 sessions (4.9 to 8.0 mm in single sessions)`."""
    mean, n = mean_and_n
    text = f"{number(mean, 1)} mm on average over {counted(n, 'session')}"
    errors = [row["rmse_mm"] for row in material.rows("accuracy") if row["estimator"] == estimator]
    if n > 1:
        text += f" ({number(min(errors), 1)} to {number(max(errors), 1)} mm in single sessions)"
    return estimator, text


def statement(material: Material, stands_alone: bool) -> Iterator[Text]:
    """The sentence on accuracy below the answer, if there is one.

    Where it `stands_alone`, the answer at the top of the page is about the estimators too: what that and the key
    figures have said is not said again.
    """
    means = _mean_errors(material)
    if not means:
        return
    if without_reference(material.results) or contradicted(material):
        if not stands_alone:
            unsure = contradicted(material)
            yield (Strong("Accuracy: "), *([f"{unsure} "] if unsure else []), _distances(material))
        return
    if stands_alone:
        unnamed = [f"{name} {number(mean, 1)} mm" for name, (mean, _) in list(means.items())[KEY_FIGURES_MAX:]]
        if unnamed:
            yield (Strong("Other estimators: "), f"a mean RMSE of {listing(unnamed)}.")
        return
    (best, (lowest, n)), *rest = means.items()
    others = "; ".join(f"{name} {number(mean, 1)} mm" for name, (mean, _) in rest)
    text = (
        f"{best} comes closest to the reference, with a root mean square error (RMSE) of {number(lowest, 1)} mm on"
        f" average over {counted(n, 'session')}."
    )
    yield (Strong("Accuracy: "), text + (f" Others: {others}." if others else ""))


def key_figures(material: Material) -> list[KeyFigure]:
    """Each estimator's mean error, best first; none where it is not known which is best."""
    if without_reference(material.results) or contradicted(material):
        return []
    return [
        KeyFigure(f"{number(mean, 1)} mm", f"{name}: position error", f"mean RMSE of {counted(n, 'session')}")
        for name, (mean, n) in _mean_errors(material).items()
    ]


def figure(material: Material) -> Figure | None:
    """Error and lag of every estimator; None where nothing was measured."""
    rows = pd.DataFrame(material.rows("accuracy"))
    if rows.empty:
        return None
    return material.drawn("answer", figures.errors, rows, not_ranked(material))


def _mean_errors(material: Material) -> dict[str, tuple[float, int]]:
    """Mean RMSE over sessions and how many they are, by estimator; best first where that is known."""
    ranked = material.rows("accuracy_means")
    if not (without_reference(material.results) or contradicted(material)):
        ranked = sorted(ranked, key=lambda row: row["rmse_mm"])
    return {row["estimator"]: (row["rmse_mm"], row["n"]) for row in ranked}


def _distances(material: Material) -> str:
    """How far each estimator is from the reference or the smoothed readings, in the study's order, none called best."""
    by_estimator = listing([f"{name} {number(mean, 1)} mm" for name, (mean, _) in _mean_errors(material).items()])
    if without_reference(material.results):
        return f"Root mean square distance from the smoothed readings, which is not an error: {by_estimator}."
    return f"Root mean square error, means over all sessions, those included: {by_estimator}."

"""What a reader of the results has to be careful about, one line each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from pipeline.analysis.kinds_of_values import SHAPE
from pipeline.report.document.model import Strong, Text
from pipeline.report.prose.accuracy_claims import sessions_in_doubt, without_reference
from pipeline.report.sections import checks, preregistration
from pipeline.report.sections.material import Material
from pipeline.statistics import T_BEYOND
from pipeline.study.statistical_tests import TESTS
from pipeline.tables.table import Row
from pipeline.words.accuracy_reference import reference_phrase
from pipeline.words.comparison import no_variance_between_participants
from pipeline.words.names import measure_label
from pipeline.words.phrases import counted, listing

_REMARKS_MAX = 3
_FEW = 8  # participants
NOT_KNOWN = "Absolute error and lag cannot be known: no reference was recorded."


def contradicted(material: Material) -> str:
    """Why no estimator is called the best although there is a reference: sessions with a red check; else nothing."""
    named, rated = sessions_in_doubt(material.results)
    if not named:
        return ""
    verb = "contradicts" if len(named) == 1 else "contradict"
    shown = ", ".join(named[:_REMARKS_MAX]) + (", …" if len(named) > _REMARKS_MAX else "")
    return (
        f"Which estimator is best is not said: {len(named)} of {counted(rated, 'session')} {verb} what"
        f" study.yaml states or their own readings ({shown}); see “Data quality and exclusions”."
    )


def cautions(material: Material) -> list[Text]:
    """From what the data contradict and where they come from, through assumptions and design, to what is missing."""
    return [
        *_of_reference(material),
        *preregistration.caution(material),
        *checks.caution(material),
        *checks.worse_than_tracker(material),
        *checks.of_tables(material),
        *_of_data(material),
        *_of_assumptions(material),
        *_of_design(material),
        *_of_gaps(material),
    ]


def _of_reference(material: Material) -> Iterator[Text]:
    if without_reference(material.results):
        text = (
            " Figures of accuracy are distances from the smoothed readings of the study's own sensors: what these have"
            " wrong together, such as a latency, does not show, and no estimator can be called the best."
        )
        yield (Strong(NOT_KNOWN), text)


def _of_data(material: Material) -> Iterator[Text]:
    origin, n = material.study.data_origin, material.results["study"]["participants"]["n"]
    if origin == "reconstructed":
        yield (Strong("The data are reconstructed: "), "they fit printed figures and were not measured with anybody.")
    if origin == "simulated":
        yield (Strong("The data are simulated: "), "they show what a model does, not what people do.")
    if material.rows("comparisons") and n < _FEW:
        text = f"with n = {n}, intervals are wide and it cannot be checked whether data are normally distributed."
        yield (Strong("Few participants: "), text)


def _details(row: Row, *names: str) -> float | None:
    """The first of these figures that a row has."""
    details = row["details"] or {}
    return next((details[name] for name in names if details.get(name) is not None), None)


def _named(rows: list[Row]) -> str:
    """Their measures, each once."""
    return listing(list(dict.fromkeys(measure_label(row["measure"]) for row in rows)))


def _of_assumptions(material: Material) -> Iterator[Text]:
    alpha, rows = material.study.alpha, material.rows("comparisons")

    def below(row: Row, *names: str) -> bool:
        found = _details(row, *names)
        return found is not None and found < alpha

    beyond = [row for row in material.rows("descriptives") if row["interval"] == T_BEYOND]
    if beyond:
        text = (
            f"for {_named(beyond)}, although all values lie between: a share cannot be there. State each answer as 0 or"
        )
        yield (Strong("A t interval reaches beyond 0 to 1 "), f"{text} 1, with its trial, or read it as approximate.")
    violated = [row for row in rows if TESTS[row["test"]].assumes_sphericity and below(row, "mauchly_p")]
    if violated:
        text = f"(the differences between conditions vary unequally) for {_named(violated)}: use the"
        yield (Strong("Sphericity is violated "), f"{text} Greenhouse-Geisser p.")
    resting = [row for row in rows if TESTS[row["test"]].assumes_normality]
    skewed = [row for row in resting if below(row, "shapiro_p", "residual_shapiro_p")]
    if skewed:
        text = f"(Shapiro-Wilk test) for {_named(skewed)}: check whether a rank test gives the same result."
        yield (Strong("Differences are not normally distributed "), text)
    shaped = [row for row in material.rows("design_check") if row["what"] == SHAPE]
    if shaped:
        text = f"in {_named(shaped)}: transform: log in study.yaml tests the logarithms and says by what factor the"
        yield (Strong("Skewed values "), f"{text} geometric means differ; see whether it gives the same result.")
    yield from _far_out(resting)
    yield from _aligned_ranks(rows)
    singular = [row for row in rows if no_variance_between_participants(row)]
    if singular:
        text = f"of the mixed model for {_named(singular)}: it finds no variance between participants, so it"
        yield (Strong("Singular fit "), f"{text} treats all rows as if they came from different people.")
    yield from _left_out_intercepts(rows)
    undefined = sum(row["status"] != "ok" for row in rows)
    if undefined:
        yield (f"{counted(undefined, 'comparison')} cannot be computed; the table of comparisons says why.",)
    narrow = [
        row["estimator"] for row in material.rows("accuracy") if row["coverage_95"] < 0.9 and row["estimator"] != "raw"
    ]
    if narrow:
        standard = reference_phrase(row["reference"] for row in material.rows("accuracy"))
        text = f"in at least one session for {listing(list(dict.fromkeys(narrow)))}: the 95 % intervals contain"
        yield (Strong("Stated uncertainty too small "), f"{text} {standard} in less than 90 % of instants.")


def _left_out_intercepts(rows: list[Row]) -> Iterator[Text]:
    """Random intercepts beside the participants' that a mixed model does without, since it finds no variance there."""
    without: dict[str, list[Row]] = {}
    for row in rows:
        for name, variance in ((row["details"] or {}).get("variances") or {}).items():
            if variance == 0 and name != "participant":
                without.setdefault(name, []).append(row)
    for name, concerned in without.items():
        text = f"of each {name.replace(':', ' × ')}, in the mixed model for {_named(concerned)}: it finds no variance"
        yield (Strong("A random intercept is left out, that "), f"{text} between them.")


def _misshapen(row: Row) -> bool:
    """Are its values skewed, or do its cells spread unequally?"""
    details = row["details"] or {}
    return bool(details.get("skewed") or details.get("spreads_differ"))


def _aligned_ranks(rows: list[Row]) -> Iterator[Text]:
    """Aligned ranks of skewed data: an effect leaks into the others, and there are far too many false alarms."""
    concerned = [row for row in rows if TESTS[row["test"]].ranks_aligned and _misshapen(row)]
    if concerned:
        named = _named(concerned)
        text = f"of data that are skewed or spread unequally ({named}) can find effects that do not exist where another"
        yield (
            Strong("Aligned ranks "),
            f"{text} factor has a strong one; an ANOVA of the logarithms does not have this problem.",
        )


def _far_out(rows: list[Row]) -> Iterator[Text]:
    """Participants whose difference lies far from the others'."""
    concerned = [row for row in rows if (row["details"] or {}).get("outliers")]
    people = list(dict.fromkeys(person for row in concerned for person in row["details"]["outliers"]))
    if people:
        who = listing(people) if len(people) <= _REMARKS_MAX else counted(len(people), "participant")
        text = f"in {_named(concerned)}: {who} (kept in all tests). Look at the figures."
        yield (Strong("Outliers "), text)


def _of_design(material: Material) -> Iterator[Text]:
    """The remarks of the design check: order of the conditions, period, carry-over, cells."""
    remarked = [row for row in material.rows("design_check") if row["remark"] and row["what"] != SHAPE]
    told = [f"{row['what']}: {row['remark']}" for row in remarked]
    if told:
        more = f"; and {len(told) - _REMARKS_MAX} more" if len(told) > _REMARKS_MAX else ""
        yield (Strong("Design: "), f"{'; '.join(told[:_REMARKS_MAX])}{more}. See “Design and participants”.")


def _of_gaps(material: Material) -> Iterator[Text]:
    contradictions = sum(row["verdict"] == "contradiction" for row in material.rows("printed"))
    if contradictions:
        verb = "contradicts" if contradictions == 1 else "contradict"
        figures = f"{counted(contradictions, 'printed figure')} {verb} others of the same publication"
        yield (f"{figures}; see “Printed and computed”.",)
    kinds = Counter(row["what"] for row in material.rows("exclusions"))
    if kinds:
        told = listing([f"{what} ({count})" for what, count in kinds.items()])
        yield (Strong("Missing or excluded: "), f"{told}; see “Data quality and exclusions”.")

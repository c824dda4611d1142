"""What a reader of the results should be careful about, one line each: the notice of the first page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from pipeline.analysis.kinds_of_values import SHAPE
from pipeline.report.document.model import Strong, Text
from pipeline.report.prose.accuracy_claims import sessions_in_doubt, without_reference
from pipeline.report.sections import checks, preregistration, recorded_live
from pipeline.report.sections.material import Material
from pipeline.statistics import OK, T_BEYOND
from pipeline.statistics.tukey import METHOD as TUKEY_KRAMER
from pipeline.study.statistical_tests import TESTS
from pipeline.tables.table import Row
from pipeline.words.accuracy_reference import reference_phrase
from pipeline.words.comparison import decisive_p, no_variance_between_participants
from pipeline.words.names import measure_label
from pipeline.words.phrases import counted, listing

_REMARKS_MAX = 3
_FEW = 8  # participants
NO_REFERENCE = "Absolute error and lag cannot be known: no reference was recorded."


def contradicted(material: Material) -> str:
    """Why no estimator is called best although there is a reference: sessions with a red check. Empty without any."""
    in_doubt, rated = sessions_in_doubt(material.results)
    if not in_doubt:
        return ""
    verb = "contradicts" if len(in_doubt) == 1 else "contradict"
    shown = ", ".join(in_doubt[:_REMARKS_MAX]) + (", …" if len(in_doubt) > _REMARKS_MAX else "")
    return (
        f"Which estimator is best is not said: {len(in_doubt)} of {counted(rated, 'session')} {verb} what"
        f" study.yaml states or their own readings ({shown}); see “Data quality and exclusions”."
    )


def not_ranked(material: Material) -> str:
    """The same in a few words, for captions below the table that says why. Empty where estimators are ranked."""
    return "Which is best is not said, for the reason above." if contradicted(material) else ""


def cautions(material: Material) -> list[Text]:
    """All cautions, the gravest first: what contradicts the data, where they come from, assumptions, design, gaps."""
    return [
        *_no_reference(material),
        *preregistration.caution(material),
        *checks.caution(material),
        *checks.worse_than_tracker(material),
        *checks.suspicious_values(material),
        *recorded_live.cautions(material),
        *_origin_and_size(material),
        *_assumptions(material),
        *_design_remarks(material),
        *_gaps(material),
    ]


def _no_reference(material: Material) -> Iterator[Text]:
    if without_reference(material.results):
        text = (
            " Figures of accuracy are distances from the smoothed readings of the study's own sensors: what these have"
            " wrong together, such as a latency, does not show, and no estimator can be called the best."
        )
        yield (Strong(NO_REFERENCE), text)


def _origin_and_size(material: Material) -> Iterator[Text]:
    origin, n = material.study.data_origin, material.results["study"]["participants"]["n"]
    if origin == "reconstructed":
        yield (Strong("The data are reconstructed: "), "they fit printed figures and were not measured with anybody.")
    if origin == "simulated":
        yield (Strong("The data are simulated: "), "they show what a model does, not what people do.")
    if material.rows("comparisons") and n < _FEW:
        text = f"with n = {n}, intervals are wide and it cannot be checked whether data are normally distributed."
        yield (Strong("Few participants: "), text)


def _first_detail(row: Row, *names: str) -> float | None:
    """The first of these entries of the row's details that it has."""
    details = row["details"] or {}
    return next((details[name] for name in names if details.get(name) is not None), None)


def _measures_of(rows: list[Row]) -> str:
    """The measures of these rows, each once."""
    return listing(list(dict.fromkeys(measure_label(row["measure"]) for row in rows)))


def _assumptions(material: Material) -> Iterator[Text]:
    alpha, rows = material.study.alpha, material.rows("comparisons")

    def below(row: Row, *names: str) -> bool:
        p = _first_detail(row, *names)
        return p is not None and p < alpha

    beyond = [row for row in material.rows("descriptives") if row["interval"] == T_BEYOND]
    if beyond:
        text = (
            f"for {_measures_of(beyond)}, although all values lie between: a share cannot be there. State each answer"
            " as 0 or"
        )
        yield (Strong("A t interval reaches beyond 0 to 1 "), f"{text} 1, with its trial, or read it as approximate.")
    violated = [row for row in rows if TESTS[row["test"]].assumes_sphericity and below(row, "mauchly_p")]
    if violated:
        text = f"(the differences between conditions vary unequally) for {_measures_of(violated)}: what is said here"
        yield (Strong("Sphericity is violated "), f"{text} rests on the Greenhouse-Geisser p.")
    assuming_normality = [row for row in rows if TESTS[row["test"]].assumes_normality]
    skewed = [row for row in assuming_normality if below(row, "shapiro_p", "residual_shapiro_p")]
    if skewed:
        text = f"(Shapiro-Wilk test) for {_measures_of(skewed)}: check whether a rank test gives the same result."
        yield (Strong("Differences are not normally distributed "), text)
    groups = [row for row in assuming_normality if _below_in_a_group(row, alpha)]
    if groups:
        text = f"(Shapiro-Wilk test) for {_measures_of(groups)}: check whether a rank test gives the same result."
        yield (Strong("Values within a group are not normally distributed "), text)
    unlike = [row for row in rows if row["contrast"] is None and _takes_one_sd(rows, row) and below(row, "levene_p")]
    if unlike:
        text = f"(Levene's test) in {_measures_of(unlike)}, and Tukey and Kramer's pairs take one SD for all of them:"
        yield (Strong("Groups spread differently "), f"{text} without “follow_up: tukey” each pair has its own.")
    shaped = [row for row in material.rows("design_check") if row["what"] == SHAPE]
    if shaped:
        text = f"in {_measures_of(shaped)}: see whether a test of the logarithms (“transform: log” in study.yaml) gives"
        yield (Strong("Skewed values "), f"{text} the same result.")
    yield from _interactions(rows, alpha)
    yield from _outliers(assuming_normality)
    yield from _aligned_ranks(rows)
    singular = [row for row in rows if no_variance_between_participants(row)]
    if singular:
        text = f"of the mixed model for {_measures_of(singular)}: it finds no variance between participants, so it"
        yield (Strong("Singular fit "), f"{text} treats all rows as if they came from different people.")
    yield from _left_out_intercepts(rows)
    yield from _groups_of_one(material)
    undefined = sum(row["status"] != "ok" for row in rows)
    if undefined:
        yield (f"{counted(undefined, 'comparison')} cannot be computed; the table of comparisons says why.",)
    yield from _narrow_intervals(material)


def _takes_one_sd(rows: Sequence[Row], omnibus: Row) -> bool:
    """Whether the pairs after a test of all groups take these to spread alike."""
    same = ("measure", "test", "effect")
    return any(row["method"] == TUKEY_KRAMER and all(row[key] == omnibus[key] for key in same) for row in rows)


def _below_in_a_group(row: Row, alpha: float) -> bool:
    """Whether the values of a group speak against a normal distribution of them."""
    return any(p is not None and p < alpha for p in (row["details"] or {}).get("groups_shapiro_p", ()))


def _groups_of_one(material: Material) -> Iterator[Text]:
    """Groups of which a single participant stands for all: nothing tells how far its members lie apart."""
    tested = {
        row["measure"] for row in material.rows("comparisons") if row["status"] == OK and _has_a_group_of_one(row)
    }
    alone = [row for row in material.rows("descriptives_by_group") if row["group_n"] == 1 and row["measure"] in tested]
    if alone:
        groups = listing(list(dict.fromkeys(f"{row['factor']} “{row['group']}”" for row in alone)))
        text = (
            f"in {groups}, for {_measures_of(alone)}: its mean, and how it differs from the others, are that person's"
            " alone, and a mean over the groups counts that person as much as a whole group."
        )
        yield (Strong("A single participant "), text)


def _has_a_group_of_one(row: Row) -> bool:
    return 1 in (row["details"] or {}).get("n_groups", ())


def _narrow_intervals(material: Material) -> Iterator[Text]:
    """Estimators whose stated uncertainty is too small."""
    stated = [row for row in material.rows("accuracy") if row["estimator"] != "raw"]
    narrow = Counter(row["estimator"] for row in stated if row["coverage_95"] < 0.9)
    if narrow:
        standard = reference_phrase(row["reference"] for row in material.rows("accuracy"))
        sessions = Counter(row["estimator"] for row in stated)
        found = [f"{name} in {count} of {counted(sessions[name], 'session')}" for name, count in narrow.items()]
        text = f"for {listing(found)}: the 95 % intervals contain"
        yield (Strong("Stated uncertainty too small "), f"{text} {standard} in less than 90 % of instants.")


def _interactions(rows: list[Row], alpha: float) -> Iterator[Text]:
    """Differences between conditions that depend on another factor, so that no single number tells them."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        parts = row["effect"].split(":")
        p = decisive_p(row)
        if "condition" in parts and len(parts) > 1 and row["contrast"] is None and p is not None and p < alpha:
            found.setdefault(listing([part for part in parts if part != "condition"]), []).append(row)
    for others, rows_of in found.items():
        text = f"in {_measures_of(rows_of)} it is not the same at each level of {others} (the interaction is"
        yield (Strong("The difference depends: "), f"{text} significant); see the pairs at each level.")


def _left_out_intercepts(rows: list[Row]) -> Iterator[Text]:
    """Random intercepts other than the participants' whose variance a mixed model estimates as zero and leaves out."""
    without: dict[str, list[Row]] = {}
    for row in rows:
        for name, variance in ((row["details"] or {}).get("variances") or {}).items():
            if variance == 0 and name != "participant":
                without.setdefault(name, []).append(row)
    for name, concerned in without.items():
        whose = f"(that of each {name.replace(':', ' × ')}) in the mixed model for {_measures_of(concerned)}:"
        yield (Strong("A random intercept is left out "), f"{whose} it finds no variance between them.")


def _skewed_or_unequal(row: Row) -> bool:
    """Whether the row's values are skewed, or its cells spread unequally."""
    details = row["details"] or {}
    return bool(details.get("skewed") or details.get("spreads_differ"))


def _aligned_ranks(rows: list[Row]) -> Iterator[Text]:
    """Aligned ranks of skewed data: one effect leaks into the others, with far too many false positives."""
    concerned = [row for row in rows if TESTS[row["test"]].ranks_aligned and _skewed_or_unequal(row)]
    if concerned:
        measures = _measures_of(concerned)
        text = (
            f"of data that are skewed or spread unequally ({measures}) can find effects that do not exist where another"
        )
        yield (
            Strong("Aligned ranks "),
            f"{text} factor has a strong one; an ANOVA of the logarithms does not have this problem.",
        )


def _outliers(rows: list[Row]) -> Iterator[Text]:
    """Participants whose difference lies far from those of the others."""
    concerned = [row for row in rows if (row["details"] or {}).get("outliers")]
    people = list(dict.fromkeys(person for row in concerned for person in row["details"]["outliers"]))
    if people:
        who = listing(people) if len(people) <= _REMARKS_MAX else counted(len(people), "participant")
        text = f"in {_measures_of(concerned)}: {who} (kept in all tests). Look at the figures."
        yield (Strong("Outliers "), text)


def _design_remarks(material: Material) -> Iterator[Text]:
    """The remarks of the design check: order of the conditions, period, carry-over, cells."""
    remarked = [row for row in material.rows("design_check") if row["remark"] and row["what"] != SHAPE]
    remarks = [f"{row['what']}: {row['remark']}" for row in remarked]
    if remarks:
        more = f"; and {len(remarks) - _REMARKS_MAX} more" if len(remarks) > _REMARKS_MAX else ""
        yield (Strong("Design: "), f"{'; '.join(remarks[:_REMARKS_MAX])}{more}. See “Design and participants”.")


def _gaps(material: Material) -> Iterator[Text]:
    contradictions = sum(row["verdict"] == "contradiction" for row in material.rows("printed"))
    if contradictions:
        verb = "contradicts" if contradictions == 1 else "contradict"
        figures = f"{counted(contradictions, 'printed figure')} {verb} others of the same publication"
        yield (f"{figures}; see “Printed and computed”.",)
    kinds = Counter(row["what"] for row in material.rows("exclusions"))
    if kinds:
        counts = listing([f"{what} ({count})" for what, count in kinds.items()])
        yield (Strong("Missing or excluded: "), f"{counts}; see “Data quality and exclusions”.")

"""Words to paste into a paper: the methods, a sentence for every comparison, and what to cite."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

from pipeline.report.document.model import (
    Block,
    CrossReference,
    Paragraph,
    Section,
    Strong,
    Table,
    Text,
    ToPaste,
    columns,
)
from pipeline.report.prose.methods import methods
from pipeline.report.prose.references import Reference, bibliography, used
from pipeline.report.sections import practice
from pipeline.report.sections.cautions import contradicted
from pipeline.report.sections.comparisons import anchor
from pipeline.report.sections.material import Material
from pipeline.report.sections.provenance import statistics_libraries, used_versions
from pipeline.statistics import WILSON
from pipeline.words.accuracy_reference import SMOOTHED, reference_phrase
from pipeline.words.condition_means import means_sentence, states_means, study_facts
from pipeline.words.numbers import milliseconds, number
from pipeline.words.phrases import counted, listing
from pipeline.words.sentences import finds_nothing_of_a_pair, full_sentence, no_difference_sentence

BIBLIOGRAPHY = "references.bib"
"""The file beside the report."""


def section(material: Material) -> Section:
    """Texts to paste."""
    versions = used_versions(statistics_libraries(material.results))
    methods_text = methods(material.study, material.results, versions)
    introduction = "These texts are written from the tables of this report. Put them into your own words."
    blocks: list[Block] = [
        Paragraph((introduction,)),
        ToPaste("Methods", ((Strong("Methods. "), methods_text),)),
    ]
    results = [*_results(material), *_accuracy(material)]
    if results:
        blocks.append(ToPaste("Results", ((Strong("Results. "), *results[0]), *results[1:])))
    return Section("paste", "To paste", (*blocks, _references(material)))


def references(material: Material) -> list[Reference]:
    """The publications and programs that the study's report rests on."""
    rows, measures = material.rows("comparisons"), material.measured()
    versions = used_versions(statistics_libraries(material.results))
    return used(material.study, rows, measures, versions, _cited_for_sections(material))


def _cited_for_sections(material: Material) -> Iterator[tuple[str, str]]:
    """Keys of references.bib, with what they are cited for, of sections and figures rather than of tests."""
    if practice.section_rows(material):
        yield "newell1981", "power law of practice"
    if material.rows("fitts"):
        yield "soukoreff2004", "Fitts' law"
    if any(row["interval"] == WILSON for row in material.rows("descriptives")):
        yield "wilson1927", "intervals of shares of answers"
    if material.rows("intervals_within"):
        yield "morey2008", "intervals within participants"


def bibtex(material: Material) -> str:
    """The content of references.bib."""
    return bibliography(references(material))


def _results(material: Material) -> Iterator[Text]:
    """One paragraph per measure and test: a sentence per row, with a link to it; pairs that do not differ share one."""
    study = material.study
    facts = study_facts(study.conditions, study.alpha, material.rows("descriptives"))
    rows = list(enumerate(material.rows("comparisons")))
    # A measure none of whose sentences states means gets a sentence of its own for them, before its first test.
    without_means = {row["measure"] for _, row in rows} - {
        row["measure"] for _, row in rows if states_means(row, facts)
    }
    for (measure, _), group in groupby(rows, key=lambda item: (item[1]["measure"], item[1]["test"])):
        means = means_sentence(measure, facts) if measure in without_means else ""
        without_means.discard(measure)
        words: list[str | Strong | CrossReference] = [f"{means} "] if means else []
        of_test = list(group)
        together = {at: row for at, row in of_test if finds_nothing_of_a_pair(row, facts)}
        if len(together) == 1:
            together = {}
        for at, row in of_test:
            if at not in together:
                words += [f"{full_sentence(row, facts)} ", CrossReference("[row]", anchor(at)), " "]
        if together:
            parts, evidence = no_difference_sentence(list(together.values()), facts)
            for at, part in zip(together, parts, strict=False):  # one part may tell of all pairs
                words += [part, " ", CrossReference("[row]", anchor(at))]
            words += [evidence, "."]
        yield tuple(words)


def _accuracy(material: Material) -> Iterator[Text]:
    """Error and lag of each estimator in a sentence, where a reference was recorded that no check contradicts."""
    each, means = material.rows("accuracy"), material.rows("accuracy_means")
    if not means or any(row["reference"] == SMOOTHED for row in each) or contradicted(material):
        return
    standard = reference_phrase(row["reference"] for row in each)
    of_estimators = [
        f"{number(row['rmse_mm'])} mm with {row['estimator']}"
        + ("" if row["lag_s"] is None else f" (lag {milliseconds(row['lag_s'])} ms)")
        for row in means
        if row["rmse_mm"] is not None
    ]
    if of_estimators:
        sessions = counted(len({row["session"] for row in each}), "session")
        yield (
            f"The root mean square error against {standard}, as the mean over {sessions}, was {listing(of_estimators)};"
            " a positive lag is late.",
        )


def _references(material: Material) -> Table:
    listed = references(material)
    works = [reference for reference in listed if not reference.package]
    packages = [reference.of_package for reference in listed if reference.package]
    return Table(
        "table-references",
        f"What was used and should be cited; {BIBLIOGRAPHY} beside this report holds the same entries for BibTeX.",
        columns(("Publication", "Used for", "Key"), 3),
        tuple((reference.text, reference.used_for, reference.key) for reference in works),
        f"Packages, with the keys of their publications: {listing(packages)}." if packages else "",
    )

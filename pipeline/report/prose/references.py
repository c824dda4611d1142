"""The references of a report, as BibTeX and as text: only what was used, from the entries of references.bib."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from pipeline.study.measures import measure
from pipeline.study.settings import Study
from pipeline.study.statistical_tests import ADJUSTMENTS, TESTS
from pipeline.tables.table import Row
from pipeline.words.comparison import uses_logarithms
from pipeline.words.estimators import estimator_in_words
from pipeline.words.evidence import resampled

PAPER = "feng2017"
_OF_EFFECT_SIZE = {
    "generalized eta squared": "olejnik2003",
    "Cohen's d_z": "lakens2013",
    "Cohen's d_av": "delacre2021",
    "matched-pairs rank-biserial": "kerby2014",
    "Kendall's W": "kendall1939",
}
_OF_PAIRS = {
    "Games and Howell": ("games1976", "every two groups"),
    "Tukey and Kramer": ("kramer1956", "every two groups"),
}
_OF_ESTIMATOR = {
    "one_euro": "casiez2012",
    "holt": "holt2004",
    "position_kalman": "kalman1960",
    "window_gp": PAPER,
    "fusion_kalman": "kalman1960",
    "fusion_adaptive": "kalman1960",
}
_OF_PACKAGE = {
    "numpy": "harris2020",
    "scipy": "virtanen2020",
    "pandas": "mckinney2010",
    "numba": "lam2015",
    "matplotlib": "hunter2007",
    "vqf": "laidig2023",
    "pingouin": "vallat2018",
    "statsmodels": "seabold2010",
}
_PACKAGE = "package_"  # begins the key of a program without a publication
_ENTRY = re.compile(r"@(\w+)\{([\w.-]+),\n(.*?)\n\}", re.DOTALL)
_FIELD = re.compile(r"  (\w+) = \{(.*)\},?")
_DOI = re.compile(r"10\.\d{4,9}/[A-Za-z0-9./()-]*[A-Za-z0-9]")
_LATEX = str.maketrans(
    {
        **{mark: f"\\{mark}" for mark in "#$%&_"},
        "\\": r"\textbackslash{}",
        "{": r"\textbraceleft{}",
        "}": r"\textbraceright{}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        **dict.fromkeys((*range(32), *range(127, 160)), " "),
    }
)


@dataclass(frozen=True)
class Reference:
    """An entry of a bibliography: its kind and key, its fields as BibTeX has them, and what it was used for.

    `package` is the name and version of the package whose entry it is, if it is one's.
    """

    kind: str
    key: str
    fields: Mapping[str, str]
    used_for: str = ""
    package: str = ""

    @property
    def of_package(self) -> str:
        """`numpy (harris2020)`, or without a key where the package has no publication."""
        return self.package + ("" if self.key.startswith(_PACKAGE) else f" ({self.key})")

    @property
    def bibtex(self) -> str:
        """The entry."""
        lines = [f"  {name} = {{{value}}},\n" for name, value in self.fields.items()]
        return f"@{self.kind}{{{self.key},\n{''.join(lines)}}}\n"

    @property
    def text(self) -> str:
        """The entry for people: authors, year, title, where, DOI."""
        field = {name: _unescaped(value) for name, value in self.fields.items()}
        authors = field.get("author", "").replace(" and others", ", et al.").replace(" and ", ", ")
        issue = f"({field['number']})" if "number" in field else ""
        where = " ".join(filter(None, (field.get("journal", field.get("booktitle")), field.get("volume", "") + issue)))
        edition = f"{field['edition']} ed." if "edition" in field else ""
        source = ", ".join(filter(None, (where, field.get("pages"), edition, field.get("publisher"))))
        head = " ".join(filter(None, (authors, f"({field['year']})." if "year" in field else "")))
        stands_in_note = field.get("doi", "") in field.get("note", "")  # a study's own citation holds it already
        doi = f"doi {field['doi']}" if "doi" in field and not stands_in_note else ""
        title = ", version ".join(filter(None, (field.get("title"), field.get("version"))))
        sentences = (f"{part.rstrip('.')}." for part in (title, source, field.get("note")) if part)
        return " ".join(filter(None, (head, *sentences, doi)))


def used(
    study: Study,
    rows: Sequence[Row],
    measures: Iterable[str],
    versions: Mapping[str, str],
    shown: Iterable[tuple[str, str]] = (),
) -> list[Reference]:
    """What the study rests on: its source, the paper, tests, questionnaires, estimators, packages; each once.

    `rows` are its comparisons, `versions` those of the packages that made the report. `shown` are the references of
    what else the report shows, each a key of references.bib and what it is used for.
    """
    uses: dict[str, list[str]] = {}
    for key, used_for in (*_of_methods(rows), *_of_measures(measures), *shown, *_of_estimators(study)):
        if used_for not in uses.setdefault(key, []):
            uses[key].append(used_for)
    source = _source(study)
    listed = [source] if source else []
    uses = {PAPER: ["the method that Steadyhand implements", *uses.pop(PAPER, [])], **uses}
    listed += [_with(entries()[key], "; ".join(used_for)) for key, used_for in uses.items()]
    return listed + [_package(name, version, uses) for name, version in versions.items()]


def bibliography(references: Iterable[Reference]) -> str:
    """The file references.bib."""
    return "\n".join(reference.bibtex for reference in references)


def _with(reference: Reference, used_for: str, **fields: str) -> Reference:
    return Reference(reference.kind, reference.key, {**reference.fields, **fields}, used_for)


def _of_methods(rows: Sequence[Row]) -> Iterator[tuple[str, str]]:
    """Tests, effect sizes, corrections and diagnostics of comparisons."""
    for row in rows:
        details = row["details"] or {}
        test = TESTS[row["test"]]
        for key in test.cite:
            yield key, test.cited_for or test.long_name
        for name, (key, used_for) in _OF_PAIRS.items():
            if name in row["method"]:
                yield key, used_for
        if "Pratt" in row["method"]:
            yield "pratt1959", "zeros of the signed-rank test"
        if row["effect_size"] is not None and row["effect_size_name"] in _OF_EFFECT_SIZE:
            yield _OF_EFFECT_SIZE[row["effect_size_name"]], row["effect_size_name"]
        if row["p_adjusted"] is not None:
            yield ADJUSTMENTS[row["adjust"]].cite, "adjusted p values"
        if uses_logarithms(row):
            yield "bland1996", "ratios of geometric means"
        yield from _of_estimates(details, test.design)
        if details.get("p_gg") is not None:
            yield "greenhouse1959", "correction for sphericity"
        if details.get("shapiro_w") is not None or details.get("residual_shapiro_w") is not None:
            yield "shapiro1965", "normality of differences"
        if "outlier_rule" in details:
            yield "iglewicz1993", "outliers"


def _of_estimates(details: Mapping[str, Any], design: str) -> Iterator[tuple[str, str]]:
    """What an entry asks for beside its test."""
    if resampled(details):
        yield "efron1987", "bootstrap intervals"
    if details.get("permutation_p") is not None:
        yield ("pitman1937" if details["permutation_exact"] else "phipson2010"), "permutation p values"
        if design == "between":
            yield "janssen1997", "permutation p values of Welch's t"
    if "one_sided_log_bf" in details:
        yield "rouder2009", "one-sided Bayes factors"
        yield "morey2014", "one-sided Bayes factors"


def _of_measures(measures: Iterable[str]) -> Iterator[tuple[str, str]]:
    """The publications that measures and questionnaires rest on."""
    for name in measures:
        used_for = "questionnaire" if measure(name).questionnaire else measure(name).label.lower()
        for key in measure(name).cite:
            yield key, used_for


def _of_estimators(study: Study) -> Iterator[tuple[str, str]]:
    for settings in study.estimators.values():
        if settings.type in _OF_ESTIMATOR:
            yield _OF_ESTIMATOR[settings.type], estimator_in_words(settings.type)


def _source(study: Study) -> Reference | None:
    """Where the study is published, as study.yaml cites it; None where that is the paper, which is listed anyway."""
    citation = " ".join(study.citation.split())
    doi = _DOI.search(citation)
    if not citation or (doi and doi.group() == entries()[PAPER].fields["doi"]):
        return None
    fields = {"title": escaped(study.title), "note": escaped(citation)}
    if doi:
        fields["doi"] = doi.group()
    return Reference("misc", "study", fields, "the study's source")


def has_publication(package: str) -> bool:
    """Whether a package is cited by a publication of its own."""
    return package in _OF_PACKAGE


def _package(name: str, version: str, listed: Mapping[str, object]) -> Reference:
    """A package with its version: by its paper, or as a program where it has none or the paper is `listed` already."""
    key = _OF_PACKAGE.get(name)
    if key is not None and key not in listed:
        published = _with(entries()[key], name, note=f"{name}, version {version}")
        return replace(published, package=name)
    fields = {"title": name, "version": version}
    return Reference("software", f"{_PACKAGE}{name}", fields, "software", name)


def escaped(text: str) -> str:
    """A user's text for BibTeX: no character of it ends a field or is a command of LaTeX."""
    return text.translate(_LATEX)


def _unescaped(value: str) -> str:
    """A field as people read it, the inverse of `escaped`."""
    for mark, code in _LATEX.items():
        if isinstance(code, str) and code.startswith("\\text"):
            value = value.replace(code, f"\0{mark}\0") if isinstance(mark, int) else value
    parts = value.split("\0")
    plain = [_unmarked(part) if at % 2 == 0 else chr(int(part)) for at, part in enumerate(parts)]
    return "".join(plain)


def _unmarked(text: str) -> str:
    text = text.replace("``", "“").replace("''", "”").replace("--", "–")
    text = re.sub(r"`([^`]*?)'(?![\w'])", r"‘\1’", text)  # an apostrophe within, as of Student's, stays one
    return re.sub(r"[{}]", "", re.sub(r"\\([#$%&_])", r"\1", text))


@cache
def entries() -> dict[str, Reference]:
    """The entries of references.bib by their keys."""
    text = Path(__file__).with_suffix(".bib").read_text(encoding="utf-8")
    return {key: Reference(kind, key, dict(_FIELD.findall(fields))) for kind, key, fields in _ENTRY.findall(text)}

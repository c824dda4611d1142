"""`plan STUDY --preregister`: what study.yaml will test, frozen, and as a page for OSF or AsPredicted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from pipeline.commands import console
from pipeline.engine.code_digest import versions
from pipeline.errors import PipelineError
from pipeline.report.prose.preregistration_page import Circumstances, page, unanswered
from pipeline.statistics import planned_effects
from pipeline.statistics.planned_effects import PlannedEffect, effect_for
from pipeline.study.comparison import Comparison
from pipeline.study.folder import PREREGISTERED, SETTINGS_FILE, load_study
from pipeline.study.preregistration import frozen_text, registered_of
from pipeline.study.settings import Study
from pipeline.study.statistical_tests import TESTS
from pipeline.study.table_parts import files_of
from pipeline.words.numbers import number

PAGE = "preregistration.md"
_POWER, _STUDIES, _SEED, _CORRELATION = 0.8, 10_000, 1, 0.5


def preregister(names: Sequence[str]) -> None:
    """Write both files into the study's folder, and print what study.yaml leaves open.

    Raises PipelineError where either file exists already: a preregistration is never overwritten.
    """
    if len(names) != 1:
        raise PipelineError(
            f"plan --preregister: needs one study folder, found {len(names)} names, as in:"
            " steadyhand plan path/to/study --preregister"
        )
    folder = Path(names[0])
    study = load_study(folder, to_be_made=True)
    for name in (PREREGISTERED, PAGE):
        if (folder / name).exists() or (folder / name).is_symlink():
            raise PipelineError(
                f"{folder / name}: already exists, and a preregistration is never overwritten. Later changes of"
                f" {SETTINGS_FILE} are listed as deviations by the report; to plan another study, copy {SETTINGS_FILE}"
                " into a folder of its own"
            )
    if not study.comparisons:
        raise PipelineError(
            f"{folder / SETTINGS_FILE}: comparisons: there are none, so there is nothing to preregister; name the"
            " measures and their tests, as in comparisons: [{measure: trial_time_s, test: t_paired}]"
        )
    text, digest = frozen_text(registered_of(study))
    version = versions(["steadyhand"]).get("steadyhand", "")
    circumstances = Circumstances(digest, version, tuple(_existing_data(folder, study)), tuple(_power_lines(study)))
    content = page(study, circumstances)
    _write(folder / PAGE, content)
    _write(folder / PREREGISTERED, text)
    console.say(f"{folder / PAGE}: questions and answers for AsPredicted and OSF")
    console.say(f"{folder / PREREGISTERED}: SHA-256 {digest}")
    missing = unanswered(study)
    if missing:
        console.warn("Not stated, and left so on the page (to state it, remove both files before they are registered,")
        console.warn(f"and add to {SETTINGS_FILE}):")
        for what in missing:
            console.warn(f"  {what}")


def _write(path: Path, text: str) -> None:
    """Write a new file; one that appeared in the meantime is not overwritten either."""
    try:
        with path.open("x", encoding="utf-8", newline="\n") as file:
            file.write(text)
    except FileExistsError:
        raise PipelineError(f"{path}: already exists, and a preregistration is never overwritten") from None


def _existing_data(folder: Path, study: Study) -> Iterator[str]:
    """The tables and logs of the study that exist already; a participants table holds a plan, not data."""
    for field, name in study.files.items():
        is_plan = field in ("participants", "printed") or field.startswith("pictures.")
        if not is_plan and any(file.is_file() for file in files_of(folder, name)):
            yield name
    if study.sessions is not None:
        parent = (folder / study.sessions).parent
        logs = list(parent.glob(f"*{Path(study.sessions).suffix}")) if parent.is_dir() else []
        if logs:
            yield f"{study.sessions} ({len(logs)})"


# What the planned participants find -------------------------------------------------------------------------------


def _power_lines(study: Study) -> Iterator[str]:
    """The smallest effect that the planned participants find, for each test whose power is known."""
    n = study.preregistration.participants
    if n is None:
        yield "Power: not stated, for the number of participants is not."
        return
    known = {entry.test: text for entry in study.comparisons if (text := _smallest(entry, study, n)) is not None}
    for test, text in known.items():
        yield f"Power: {n} participants find {text} with a power of {_POWER:g} ({TESTS[test].long_name}, unadjusted p)."
    unknown = dict.fromkeys(entry.test for entry in study.comparisons if entry.test not in known)
    for test in unknown:
        yield f"Power of the {TESTS[test].long_name}: not computed."


def _smallest(entry: Comparison, study: Study, n: int) -> str | None:
    """`d_z ≥ 0.60`, of a design that study.yaml states completely; None of any other."""
    planned, size, name, assumed = _planned(entry, study, n)
    if planned is None or size < 2:
        return None
    smallest = effect_for(planned, size, _POWER).size
    return None if smallest is None else f"{name} ≥ {number(smallest)}{assumed}"


def _planned(entry: Comparison, study: Study, n: int) -> tuple[PlannedEffect | None, int, str, str]:
    if entry.test in ("t_paired", "wilcoxon"):
        return planned_effects.paired(entry.test, study.alpha, _STUDIES, _SEED), n, "d_z", ""
    if entry.test == "rm_anova" and entry.within == ("condition",):
        (effect,) = planned_effects.factorial((len(study.conditions),), 1, _CORRELATION, 1.0, study.alpha)
        return effect, n, "Cohen's f", f" (assumed: correlation {_CORRELATION:g}, sphericity)"
    if entry.test in ("t_welch", "mann_whitney"):
        ones = (1.0, 1.0)
        effect = planned_effects.groups(entry.test, ones, ones, study.alpha, _STUDIES, _SEED)
        return effect, n // 2, "d", " (assumed: two groups of one size and spread)"
    return None, 0, "", ""

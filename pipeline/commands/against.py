"""`check --against`: a study's comparisons in other programs, and why their figures are not always the same."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from pipeline.analysis.against import in_r
from pipeline.analysis.against.agreement import Agreement, Difference, held_against
from pipeline.analysis.against.problems import Problem, families_of, problems_of
from pipeline.analysis.against.programs import LIBRARIES, R, named
from pipeline.analysis.against.theirs import Theirs, ask
from pipeline.analysis.comparisons import answered, people_of
from pipeline.commands import console, junit, r_process
from pipeline.commands.junit import Case, Suite
from pipeline.commands.studies import for_each_study
from pipeline.engine.messages import session_messages
from pipeline.engine.result import Result
from pipeline.errors import PipelineError
from pipeline.stages import COMPARE
from pipeline.statistics import OF_LOGARITHMS
from pipeline.tables import table as tables
from pipeline.tables.table import Row

UNEXPLAINED = 1  # the exit code
_R_TIMEOUT_S = 300.0
_COLUMNS = {"effect_size": "effect size", "ci_difference_low": "interval from", "ci_difference_high": "interval to"}


@dataclass(frozen=True)
class Outcome:
    """A row of `comparisons`, and what each call that computes it says."""

    row: Row
    agreements: Sequence[Agreement]

    @property
    def title(self) -> str:
        """The row as study.yaml names what it is of."""
        row = self.row
        contrast = f", {row['contrast']}" if row["contrast"] else ""
        logarithms = OF_LOGARITHMS if OF_LOGARITHMS in row["method"] else ""
        return f"{row['measure']}, {row['test']}, {row['effect']}{contrast}{logarithms}"


def against(
    studies: Sequence[Path],
    programs: str,
    accept: bool,
    junit_file: Path | None,
    jobs: int | None,
    cache: Path | None,
    executor: str,
) -> None:
    """Print each study's comparisons beside those of other programs; exit with 1 where one differs for no known reason.

    Raises PipelineError for a program that is not known.
    """
    names = named(programs)
    if accept:
        raise PipelineError("check: --accept writes our own numbers, and --against compares; give only one of them")
    if junit_file is not None:
        junit.refuse_other(junit_file)
    rscript = _rscript(names)
    suites: list[Suite] = []

    def compare(_folder: Path, result: Result) -> int:
        for line in session_messages(result):
            console.warn(line)
        outcomes = _outcomes(result, names, rscript)
        lines = [*_lines(outcomes), _summary(result.name, outcomes)]
        for line in lines:
            console.say(line)
        suites.append(Suite(result.name, list(_cases(result.name, outcomes)), result.seconds, "\n".join(lines)))
        unexplained = any(one.unexplained for outcome in outcomes for one in outcome.agreements)
        return max(result.exit_code, UNEXPLAINED if unexplained else 0)

    def failed(folder: Path, error: PipelineError) -> None:
        name = folder.resolve().name
        headline = str(error).partition("\n")[0]
        suites.append(Suite(name, [Case(name, "can be compared", (headline, str(error)), broken=True)]))

    code = for_each_study(studies, COMPARE, jobs, cache, compare, failed=failed, executor_name=executor)
    if junit_file is not None:
        junit.write(junit_file, suites)
    sys.exit(code)


def _rscript(names: Sequence[str]) -> str | None:
    """The path of R where it is wanted and there, and a line that says which programs there are."""
    rscript = r_process.executable() if R in names else None
    versions = [LIBRARIES[name].version() for name in names if name in LIBRARIES]
    if rscript is not None:
        versions.append(r_process.version(rscript))
    if versions:
        console.say(
            f"Against {', '.join(versions)}; all compute from the same means of the same complete participants."
        )
    if R in names and rscript is None:
        console.warn("R is left out: there is no Rscript on the PATH; install R, or add its folder to the PATH")
    return rscript


def _outcomes(result: Result, names: Sequence[str], rscript: str | None) -> list[Outcome]:
    """Every row of the study's comparisons, in order, with what the programs say."""
    measured = result.entry("measure")
    measures, observations = (tables.read(name, measured) for name in ("measures", "observations"))
    answers = answered(result.study, measures, observations, people_of(result.study, result.folder))
    problems = [problem for one in answers for problem in problems_of(one)]
    problems += families_of(answers)
    of_row: dict[int, list[Agreement]] = {}
    libraries = [LIBRARIES[name].calls for name in names if name in LIBRARIES]
    for problem, in_r_too in zip(problems, _all_in_r(problems, rscript), strict=True):
        theirs = [one for calls in libraries for one in ask(calls, problem)] + in_r_too
        of_row.setdefault(id(problem.row), []).extend(held_against(problem, one) for one in theirs)
    return [Outcome(row, of_row.get(id(row), [])) for one in answers for row in one.rows]


def _all_in_r(problems: Sequence[Problem], rscript: str | None) -> list[list[Theirs]]:
    """What R says of each problem; a warning where it stopped before the end."""
    asked = [place for place, problem in enumerate(problems) if in_r.knows(problem)]
    if rscript is None or not asked:
        return [[] for _ in problems]
    files = in_r.tables([problems[place] for place in asked])
    ran = r_process.run(rscript, in_r.SCRIPT, files, in_r.ANSWERS, _R_TIMEOUT_S)
    found = in_r.read(ran.written)
    by_place = {place: found.get(number, []) for number, place in enumerate(asked)}
    if ran.failure:
        missing = sum(not answers for answers in by_place.values())
        console.warn(f"could not compute {missing} of {len(asked)} in R: {ran.failure}")
    return [by_place.get(place, []) for place in range(len(problems))]


def _lines(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """A block for each row that some program computes."""
    for outcome in outcomes:
        if not outcome.agreements:
            continue
        yield f"\n{outcome.title}, n = {outcome.row['n']}"
        for one in outcome.agreements:
            if one.failure is not None:
                yield f"  {one.call} could not: {one.failure}"
                continue
            agree = ", ".join(_named(outcome.row, quantity) for quantity in one.agree)
            yield f"  {one.call}" + (f" agrees: {agree}" if agree else "") + (", but" if agree and one.differ else "")
            yield from (f"      {_difference(outcome.row, difference)}" for difference in one.differ)


def _difference(row: Row, one: Difference) -> str:
    own = "–" if one.ours is None else f"{one.ours:.6g}"
    by = "" if one.ours is None else f" ({one.theirs - one.ours:+.3g})"
    return f"{_named(row, one.quantity)}: ours {own}, theirs {one.theirs:.6g}{by}: {one.reason or 'NO KNOWN REASON'}"


def _named(row: Row, quantity: str) -> str:
    """A figure as the row's test prints it."""
    return str(row["statistic_name"]) if quantity == "statistic" else _COLUMNS.get(quantity, quantity)


def _summary(study: str, outcomes: Sequence[Outcome]) -> str:
    """How many figures agree, differ, and why."""
    agreements = [one for outcome in outcomes for one in outcome.agreements]
    agree = sum(len(one.agree) for one in agreements)
    unexplained = sum(len(one.unexplained) for one in agreements)
    explained = sum(len(one.differ) for one in agreements) - unexplained
    failed = sum(one.failure is not None for one in agreements)
    text = f"\n{study}: {agree} figures agree, {explained} differ for a known reason, {unexplained} without one"
    if failed:
        text += f"; {failed} calls could not"
    alone = Counter(outcome.row["test"] for outcome in outcomes if not outcome.agreements)
    if alone:
        listed = ", ".join(f"{test} ({count})" for test, count in alone.items())
        text += f"; rows that no other program computes here: {listed}"
    return text


def _cases(study: str, outcomes: Sequence[Outcome]) -> Iterator[Case]:
    """A test case for each row and call; it fails where a figure differs for no known reason."""
    for outcome in outcomes:
        for one in outcome.agreements:
            lines = [_difference(outcome.row, difference) for difference in one.unexplained]
            failure = (lines[0], "\n".join(lines)) if lines else None
            yield Case(f"{study}.against", f"{outcome.title} | {one.call}", failure)

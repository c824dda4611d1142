"""`check --against`: a study's comparisons in other programs, and why their figures are not always the same."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from pipeline.analysis.against import in_r
from pipeline.analysis.against.agreement import Agreement, Difference, held_against
from pipeline.analysis.against.problems import Problem, all_problems
from pipeline.analysis.against.programs import LIBRARIES, R, named
from pipeline.analysis.against.theirs import Theirs, ask
from pipeline.analysis.comparisons import answered, people_of
from pipeline.analysis.complete_cases import read_values
from pipeline.commands import console, junit, r_process
from pipeline.commands.junit import Case, Suite
from pipeline.commands.studies import for_each_study
from pipeline.engine.messages import session_messages
from pipeline.engine.progress import show_progress
from pipeline.engine.result import Result
from pipeline.errors import PipelineError
from pipeline.stages import COMPARE
from pipeline.statistics import OF_LOGARITHMS
from pipeline.tables.table import Row

UNEXPLAINED = 1  # the exit code
_R_TIMEOUT_S = 300.0
_COLUMNS = {"effect_size": "effect size", "ci_difference_low": "interval from", "ci_difference_high": "interval to"}


@dataclass(frozen=True)
class Outcome:
    """A row of `comparisons`, and how each call of another program agrees with it."""

    row: Row
    agreements: Sequence[Agreement]

    @property
    def title(self) -> str:
        """Measure, test and contrast of the row, as study.yaml names them."""
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
        unexplained = any(agreement.unexplained for outcome in outcomes for agreement in outcome.agreements)
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
    """The path of R if it is asked for and installed; prints which programs are compared."""
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
    """Every row of the study's comparisons, in order, with the agreement of each program."""
    values = read_values(result.entry("measure"), people_of(result.study, result.folder))
    answers = answered(result.study, values)
    problems = all_problems(answers)
    of_row: dict[int, list[Agreement]] = {}
    libraries = [LIBRARIES[name].calls for name in names if name in LIBRARIES]
    with show_progress() as progress:
        if rscript is not None:
            progress.begin("asking R", 1)
        in_r_too = _all_in_r(problems, rscript)
        progress.begin("asking other programs", len(problems), "comparisons")
        for problem, from_r in zip(problems, in_r_too, strict=True):
            theirs = [figures for calls in libraries for figures in ask(calls, problem)] + from_r
            of_row.setdefault(id(problem.row), []).extend(held_against(problem, figures) for figures in theirs)
            progress.advance()
        progress.end()
    return [Outcome(row, of_row.get(id(row), [])) for answer in answers for row in answer.rows]


def _all_in_r(problems: Sequence[Problem], rscript: str | None) -> list[list[Theirs]]:
    """R's figures for each problem; a warning where R stopped before the end."""
    for_r = [place for place, problem in enumerate(problems) if in_r.knows(problem)]
    if rscript is None or not for_r:
        return [[] for _ in problems]
    files = in_r.tables([problems[place] for place in for_r])
    ran = r_process.run(rscript, in_r.SCRIPT, files, in_r.ANSWERS, _R_TIMEOUT_S)
    figures = in_r.read(ran.written)
    by_place = {place: figures.get(number, []) for number, place in enumerate(for_r)}
    if ran.failure:
        missing = sum(not answers for answers in by_place.values())
        console.warn(f"could not compute {missing} of {len(for_r)} in R: {ran.failure}")
    return [by_place.get(place, []) for place in range(len(problems))]


def _lines(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """A block for each row that some program computes."""
    for outcome in outcomes:
        if not outcome.agreements:
            continue
        yield f"\n{outcome.title}, n = {outcome.row['n']}"
        for agreement in outcome.agreements:
            if agreement.failure is not None:
                yield f"  {agreement.call} could not: {agreement.failure}"
                continue
            agree = ", ".join(_figure_name(outcome.row, quantity) for quantity in agreement.agree)
            but = ", but" if agree and agreement.differ else ""
            yield f"  {agreement.call}" + (f" agrees: {agree}" if agree else "") + but
            yield from (f"      {_difference_text(outcome.row, difference)}" for difference in agreement.differ)


def _difference_text(row: Row, figure: Difference) -> str:
    ours = "–" if figure.ours is None else f"{figure.ours:.6g}"
    by = "" if figure.ours is None else f" ({figure.theirs - figure.ours:+.3g})"
    reason = figure.reason or "NO KNOWN REASON"
    return f"{_figure_name(row, figure.quantity)}: ours {ours}, theirs {figure.theirs:.6g}{by}: {reason}"


def _figure_name(row: Row, quantity: str) -> str:
    """A figure as the row's test prints it."""
    return str(row["statistic_name"]) if quantity == "statistic" else _COLUMNS.get(quantity, quantity)


def _summary(study: str, outcomes: Sequence[Outcome]) -> str:
    """How many figures agree, differ, and why."""
    agreements = [agreement for outcome in outcomes for agreement in outcome.agreements]
    agree = sum(len(agreement.agree) for agreement in agreements)
    unexplained = sum(len(agreement.unexplained) for agreement in agreements)
    explained = sum(len(agreement.differ) for agreement in agreements) - unexplained
    failed = sum(agreement.failure is not None for agreement in agreements)
    text = f"\n{study}: {agree} figures agree, {explained} differ for a known reason, {unexplained} without one"
    if failed:
        text += f"; {failed} calls could not"
    not_computed = Counter(outcome.row["test"] for outcome in outcomes if not outcome.agreements)
    if not_computed:
        listed = ", ".join(f"{test} ({count})" for test, count in not_computed.items())
        text += f"; rows that no other program computes here: {listed}"
    return text


def _cases(study: str, outcomes: Sequence[Outcome]) -> Iterator[Case]:
    """A test case for each row and call; it fails where a figure differs for no known reason."""
    for outcome in outcomes:
        for agreement in outcome.agreements:
            lines = [_difference_text(outcome.row, difference) for difference in agreement.unexplained]
            failure = (lines[0], "\n".join(lines)) if lines else None
            yield Case(f"{study}.against", f"{outcome.title} | {agreement.call}", failure)

"""Checks of the design: orders and their balance, order effects, complete participants, and trials in each cell."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import pandas as pd

from pipeline.analysis import model_rows, orders
from pipeline.analysis.complete_cases import Request, rows_and_factors
from pipeline.analysis.factors import Factors, missing_cells
from pipeline.analysis.groups import CONDITION, between_factor, group_of_each, one_condition_each
from pipeline.analysis.kinds_of_values import skewed, yes_or_no
from pipeline.errors import PipelineError
from pipeline.statistics import OK
from pipeline.statistics.counterbalancing import balance
from pipeline.statistics.crossover import crossover
from pipeline.statistics.mixed import mixed_model
from pipeline.statistics.result import Result
from pipeline.study.comparison import Comparison
from pipeline.study.session import Session
from pipeline.study.settings import Study
from pipeline.study.statistical_tests import TESTS
from pipeline.tables.table import Row
from pipeline.words.evidence import statistic
from pipeline.words.numbers import p_phrase
from pipeline.words.phrases import counted, listing

Order = tuple[str, ...]
_NAMED = 5  # participants in a remark, before "… more"


def findings(
    study: Study,
    requests: Sequence[Request],
    order_rows: pd.DataFrame,
    trials: pd.DataFrame,
    sessions: Iterable[Session],
) -> list[Row]:
    """The rows of `design_check` for the study's comparisons; `remark` is set where a check fails.

    `order_rows` is the table `orders`.
    """
    if len(study.conditions) < 2 or not requests:
        return []
    one_per_measure = list({request.measure: request for request in requests}.values())
    people = sorted(set(requests[0].measures["participant"]))
    known = _complete_orders(study.conditions, orders.run_orders(order_rows))
    met = set(zip(requests[0].measures["participant"], requests[0].measures["condition"], strict=True))
    if one_condition_each(study, met):
        return [
            *_between(study, requests),
            *_trials(trials, one_per_measure),
            *skewed(requests),
            *_sessions(requests[0].observations, sessions),
        ]
    rows = [*_known_orders(people, known), *_disagreements(order_rows)]
    if known:
        rows += _balance(study.conditions, list(known.values()))
        rows += [row for request in one_per_measure for row in _order_effects(request)]
    rows += [
        *_complete_people(study, one_per_measure),
        *_shared_names(requests),
        *_trials(trials, one_per_measure),
        *yes_or_no(requests),
        *skewed(requests),
    ]
    return [*rows, *_sessions(requests[0].observations, sessions)]


def _between(study: Study, requests: Sequence[Request]) -> Iterator[Row]:
    """The participants of each condition where each met one, and tests that need people who met several."""
    measures = requests[0].measures
    counts = measures.groupby("condition")["participant"].nunique()
    sizes = ", ".join(f"{condition} {counts.get(condition, 0)}" for condition in study.conditions)
    within = list(
        dict.fromkeys(
            request.entry.test for request in requests if TESTS[request.entry.test].design in ("within", "mixed")
        )
    )
    remark = None
    if within:
        remark = (
            f"{listing(within)} {'needs' if len(within) == 1 else 'need'} people who met several conditions; write"
            " factors: {condition: between} and test: t_welch, mann_whitney, anova_welch or kruskal"
        )
    row = {"what": "participants of each condition, who met one each", "found": sizes, "expected": "the same in each"}
    yield {**row, "remark": remark}


def _shared_names(requests: Sequence[Request]) -> Iterator[Row]:
    """Groups that are named like conditions: a pair `A − B at A` can then be read in two ways."""
    factors: dict[str, set[str]] = {}
    for request in requests:
        if TESTS[request.entry.test].design in ("between", "mixed") and between_factor(request) not in factors:
            factor = between_factor(request)
            rows, _ = rows_and_factors(request, request.measures)
            factors[factor] = set(group_of_each(request, factor, rows).values())
    for factor, levels in factors.items():
        shared = [condition for condition in requests[0].study.conditions if condition in levels]
        if shared and factor != CONDITION:
            name = "names" if len(shared) == 1 else "name"
            remark = (
                f"{listing(shared)} {name} a condition and a group, so that pairs at a level can be read in two ways;"
                f" give the levels of {factor} names of their own"
            )
            row = {"what": "names of the groups", "found": listing(shared), "expected": "other names than conditions"}
            yield {**row, "remark": remark}


def _complete_orders(conditions: Sequence[str], run: pd.DataFrame) -> dict[str, Order]:
    """The order of each participant for whom it is known in full, with each condition met once."""
    complete: dict[str, Order] = {}
    once = run.drop_duplicates(["participant", "condition", "period"])
    for participant, rows in once.groupby("participant", sort=True):
        order = tuple(rows.sort_values("period")["condition"])
        if rows["period"].is_unique and sorted(order) == sorted(conditions):
            complete[str(participant)] = order
    return complete


def _known_orders(people: Sequence[str], known: Mapping[str, Order]) -> Iterator[Row]:
    unknown = [person for person in people if person not in known]
    row: Row = {"what": "order of the conditions", "expected": "known for everybody"}
    if not known:
        remark = "whether orders were balanced, and whether they mattered, cannot be checked"
        yield {**row, "found": "not known", "remark": remark}
        return
    found = f"known for {len(people) - len(unknown)} of {counted(len(people), 'participant')}"
    lacking = f"not known in full, with each condition once, for {_names(unknown)}" if unknown else None
    yield {**row, "found": found, "remark": lacking}


def _names(people: Sequence[str]) -> str:
    return listing([*people[:_NAMED], f"{len(people) - _NAMED} more"] if len(people) > _NAMED else list(people))


def _disagreements(order_rows: pd.DataFrame) -> Iterator[Row]:
    """Participants for whom two sources give different orders."""
    by_source = {source: orders.orders_as_text(rows) for source, rows in order_rows.groupby("source")}
    for first, second in combinations([source for source in orders.SOURCES if source in by_source], 2):
        orders_of_first, orders_of_second = by_source[first], by_source[second]
        differ = sorted(
            person
            for person in orders_of_first
            if person in orders_of_second and orders_of_first[person] != orders_of_second[person]
        )
        if differ:
            yield {
                "what": "order of the conditions",
                "found": f"{first} and {second} differ for {_names(differ)}",
                "expected": "one order",
                "remark": f"{first} are used",
            }


def _balance(conditions: Sequence[str], known: Sequence[Order]) -> Iterator[Row]:
    """How often each condition comes in each period, and just before each other condition."""
    people, count = len(known), len(conditions)
    low, over = divmod(people, count)
    share = f"{low} or {low + 1}" if over else str(low)
    spread = balance(known)
    for condition in conditions:
        times = spread.in_periods[condition]
        yield {
            "what": "times in each period",
            "condition": condition,
            "found": ", ".join(str(number) for number in times),
            "expected": f"{share} in each",
            "remark": None if _even(times, over) else "not balanced over the periods",
        }
    if count > 2:
        pairs = spread.in_pairs.values()
        yield {
            "what": "times each condition comes just before each other",
            "found": _span(pairs),
            "expected": share,
            "remark": None if _even(pairs, over) else "not balanced for the preceding condition",
        }


def _even(times: Collection[int], over: int) -> bool:
    """Are the counts as equal as they can be? `over`: participants beyond a whole number of rounds."""
    return max(times) - min(times) <= (1 if over else 0)


def _span(numbers: Iterable[int]) -> str:
    """`3`, `2 to 4`."""
    known = sorted(numbers)
    return str(known[0]) if known[0] == known[-1] else f"{known[0]} to {known[-1]}"


def _order_effects(request: Request) -> list[Row]:
    """Whether a measure changes with the period, and with the preceding condition."""
    tests: tuple[tuple[str, str, Callable[[Request], Result]], ...] = (
        ("effect of the period", "values change with the period", _period_test),
        ("carry-over", "values change with the preceding condition", _carry_over_test),
    )
    rows: list[Row] = []
    for what, remark, test in tests:
        row: Row = {"what": what, "measure": request.measure, "expected": "none"}
        try:
            rows.append({**row, **_tested(test(request), remark, request.study.alpha)})
        except PipelineError:  # an error where a comparison needs the order; here it only leaves the check open
            rows.append({**row, "found": "cannot be tested: too little is known about the order"})
    return rows


def _period_test(request: Request) -> Result:
    if len(request.study.conditions) == 2:
        return _crossover(request)[1]
    return _omnibus(request, ("condition", "factor(period)"), "period")


def _carry_over_test(request: Request) -> Result:
    if len(request.study.conditions) == 2:
        return _crossover(request)[2]
    return _omnibus(request, ("condition", "factor(period)", model_rows.CARRY_OVER), model_rows.CARRY_OVER)


def _crossover(request: Request) -> list[Result]:
    """Treatment, period and carry-over."""
    entry = Comparison(measure=request.measure, test="crossover")
    rows = model_rows.of_crossover(replace(request, entry=entry))
    return crossover(rows.values, rows.first_came_first, rows.conditions, rows.sequences)


def _omnibus(request: Request, fixed: tuple[str, ...], effect: str) -> Result:
    entry = Comparison(measure=request.measure, test="mixed_model", fixed=fixed)
    rows = model_rows.of_model(replace(request, entry=entry))
    results = mixed_model(rows.values, rows.participants, rows.columns, rows.terms)
    return next(result for result in results if result.effect == effect)


def _tested(result: Result, remark: str, alpha: float) -> Row:
    if result.status != OK or result.p is None:
        return {"found": result.status}
    figures = {name: getattr(result, name) for name in ("statistic_name", "statistic", "df1", "df2", "p")}
    found = f"{statistic(figures)}, {p_phrase(result.p)}"
    return {**figures, "found": found, "remark": remark if result.p < alpha else None}


def _complete_people(study: Study, requests: Sequence[Request]) -> Iterator[Row]:
    """Participants who lack a condition, or a cell of a further factor, in a measure that is compared."""
    what = "participants with every condition"
    complete: set[int] = set()
    for request in requests:
        rows, factors = rows_and_factors(request, request.measures)
        yield from _rare_levels(request.measure, factors)
        people = rows["participant"].nunique()
        lacking = missing_cells(rows, study.conditions, factors.crossed)
        if not lacking:
            complete.add(people)
            continue
        names = _names([f"{person} ({', '.join(cells)})" for person, cells in lacking.items()])
        remark = f"left out of tests within people, where they lack a value: {names}"
        named = f"{what} and {listing(list(factors.crossed))}" if factors.crossed else what
        found = str(people - len(lacking))
        yield {"what": named, "measure": request.measure, "found": found, "expected": str(people), "remark": remark}
    if complete:
        numbers = listing([str(number) for number in sorted(complete)])
        yield {"what": what, "found": f"all, {numbers}", "expected": "all"}


def _rare_levels(measure: str, factors: Factors) -> Iterator[Row]:
    """Levels of a factor that hardly anybody has and that are likely misspelt."""
    for level in factors.rare:
        row = {"what": f"levels of {level.factor}", "measure": measure, "expected": "used for most participants"}
        yield {**row, "found": f'only {listing(list(level.participants))} has "{level.level}"', "remark": level.reason}


def _trials(trials: pd.DataFrame, requests: Sequence[Request]) -> Iterator[Row]:
    """How many trials each cell has, or how many values, of measures that have several per cell."""
    recorded = trials[trials["estimator"] == "recorded"]
    if len(recorded):
        yield _per_cell("trials in each cell", None, recorded.groupby(["participant", "condition"]).size())
        return
    for request in requests:
        rows = request.observations[request.observations["measure"] == request.measure]
        if (rows["n"] > 1).any():
            yield _per_cell(
                "values in each cell", request.measure, rows.groupby(["participant", "condition"])["n"].sum()
            )


def _per_cell(what: str, measure: str | None, counts: pd.Series) -> Row:
    uneven = "unequal; each participant's mean counts once, whatever its number of trials"
    return {
        "what": what,
        "measure": measure,
        "found": _span(counts),
        "expected": "the same in each",
        "remark": uneven if counts.nunique() > 1 else None,
    }


def _sessions(observations: pd.DataFrame, sessions: Iterable[Session]) -> Iterator[Row]:
    """How many sessions each cell has that has any."""
    named = observations.dropna(subset="session")[["participant", "condition", "session"]]
    every = {(session.participant, session.condition, session.id) for session in sessions}
    every |= set(named.itertuples(index=False, name=None))
    counts = Counter((participant, condition) for participant, condition, _ in every)
    if not counts:
        return
    several = sorted(f"{participant} in {condition}" for (participant, condition), times in counts.items() if times > 1)
    yield {
        "what": "sessions in each cell",
        "found": _span(counts.values()),
        "expected": "1",
        "remark": f"values of several sessions are pooled: {_names(several)}" if several else None,
    }

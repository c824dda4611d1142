"""The rows of the table `preregistration`, from the frozen file, the settings and the results alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pipeline.analysis.preregistration.hypotheses import Done, hypothesis_rows
from pipeline.analysis.preregistration.tests import family_rows, test_rows
from pipeline.analysis.preregistration.verdicts import ALTERED, AS_PLANNED, DEVIATION, NOT_PLANNED, as_text, point
from pipeline.study.preregistration import FrozenFile, Registered, registered_of
from pipeline.study.preregistration_settings import Preregistration
from pipeline.study.settings import Exclusion, Study
from pipeline.tables.table import Row

_ANSWERS = tuple(name for name in Preregistration.model_fields if name != "participants")


def plan_and_done(file: FrozenFile, study: Study, done: Done) -> list[Row]:
    """Every point of the preregistration, what was done about it, and whether that is as planned."""
    plan, now = file.registered, registered_of(study)
    return [
        _file(file),
        *_settings(plan, now),
        *_participants(plan, done),
        *test_rows(plan, now, done.measures),
        *family_rows(plan, now, done.measures),
        *hypothesis_rows(plan, now, done, study.alpha),
        *_exclusions(plan.exclusions, now.exclusions),
        *_answers(plan.preregistration, now.preregistration),
    ]


def _file(file: FrozenFile) -> Row:
    stated = file.stated_digest or "no digest"
    return point("preregistered.yaml", stated, file.digest, AS_PLANNED if file.is_intact else ALTERED)


# Settings of the whole study --------------------------------------------------------------------------------------


def _settings(plan: Registered, now: Registered) -> Iterator[Row]:
    yield point("conditions, the baseline first", ", ".join(plan.conditions), ", ".join(now.conditions))
    for what, name in (
        ("displayed estimator", "shown"),
        ("factor between participants", "factors"),
        ("scoring", "scoring"),
    ):
        before, after = (_texts(getattr(one, name)) for one in (plan, now))
        for key in dict.fromkeys([*before, *after]):
            yield point(f"{what}: {key}", before.get(key, NOT_PLANNED), after.get(key, "dropped"))
    if plan.question is not None:
        yield point("pairs that are asked about", _pairs(plan), _pairs(now))
    yield point("level of significance", f"{plan.alpha:g}", f"{now.alpha:g}")


def _pairs(registered: Registered) -> str:
    """The pairs of `question`, in whichever order each is written; without any the baseline with each other one."""
    if not registered.question:
        return "the baseline with each other condition"
    order = registered.conditions.index
    pairs = {tuple(sorted(pair, key=order)) for pair in registered.question}
    return ", ".join(" - ".join(pair) for pair in sorted(pairs, key=lambda pair: [*map(order, pair)]))


def _texts(mapping: Mapping[str, Any]) -> dict[str, str]:
    """The values as text; a rule of scoring as its keys."""
    return {key: as_text(value) for key, value in mapping.items()}


def _participants(plan: Registered, done: Done) -> Iterator[Row]:
    planned = plan.preregistration.participants
    if planned is not None:
        yield point("participants", str(planned), str(done.participants))


def _exclusions(plan: Sequence[Exclusion], now: Sequence[Exclusion]) -> Iterator[Row]:
    for one in plan:
        kept = one in now
        yield point("exclusion", _excluded(one), _excluded(one) if kept else "not left out")
    for one in now:
        if one not in plan:
            yield point("exclusion", NOT_PLANNED, _excluded(one), DEVIATION)


def _excluded(one: Exclusion) -> str:
    return f"{one.named} ({one.reason})"


def _answers(plan: Preregistration, now: Preregistration) -> Iterator[Row]:
    """Rules in the study's own words that no longer say the same; whether the others were kept, nobody can compute."""
    for name in _ANSWERS:
        planned, done = getattr(plan, name), getattr(now, name)
        if planned != done:
            texts = ["not stated" if answer is None else str(answer) for answer in (planned, done)]
            yield point(name.replace("_", " "), *texts)

"""Who does which task when: participants, their orders, attempts and answers, as records tell it. Pure.

Every decision and answer is a record in the file of answers, in the order in which they were made. The plan is what
the records say, one after the other (`after`), and what lies in the folder (`with_logs`). So a recorder that was
killed knows as much as before, once it has read them.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from pipeline.statistics.counterbalancing import assigned, williams_design
from pipeline.study.recording import Pair, pair_id

Record = Mapping[str, Any]
TaskState = Literal["todo", "now", "cut", "done", "skipped"]
_TLX_POINTS = 5  # of each of the 20 steps between NASA-TLX's marks, so that ratings are 0 to 100


@dataclass(frozen=True)
class Task:
    """One condition of a participant. `answers` are by questionnaire and item; `cut_s` is how long a cut log is."""

    condition: str
    state: TaskState = "todo"
    attempt: int = 0
    trials: int = 0
    cut_s: float = 0.0
    answers: Mapping[tuple[str, str], int] = field(default_factory=dict)
    submitted: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Person:
    """A participant. `slot` counts into the balanced orders; None where a plan of the study's own says the order."""

    id: str
    slot: int | None
    tasks: tuple[Task, ...]
    dropped: bool = False
    begun: bool = False
    left_because: str = ""

    @property
    def order(self) -> tuple[str, ...]:
        """The conditions in the order in which they come."""
        return tuple(task.condition for task in self.tasks)


@dataclass(frozen=True)
class Plan:
    """All participants so far, and those that the study plans.

    `questionnaires` are ids with their items, `pairs` ids with the pairs of items that are compared besides.
    """

    conditions: tuple[str, ...]
    questionnaires: Mapping[str, tuple[str, ...]]
    persons: tuple[Person, ...] = ()
    pairs: Mapping[str, tuple[Pair, ...]] = field(default_factory=dict)

    def wanted(self, questionnaire: str) -> tuple[str, ...]:
        """Everything that a questionnaire asks: its items, and its pairs."""
        return (*self.questionnaires[questionnaire], *map(pair_id, self.pairs.get(questionnaire, ())))

    def person(self, name: str) -> Person | None:
        """The participant of that id."""
        return next((person for person in self.persons if person.id == name), None)


@dataclass(frozen=True)
class FoundLog:
    """A log in the folder: whole under its name, or cut; `digest` is that of the study it was recorded by."""

    participant: str
    condition: str
    whole: bool
    trials: int
    seconds: float
    digest: str = ""


def planned(plan: Plan, orders: Iterable[tuple[str, Sequence[str]]]) -> Plan:
    """With the participants of the study's own table, each with their order of all conditions."""
    new = [
        Person(name, None, tuple(Task(condition) for condition in order))
        for name, order in orders
        if plan.person(name) is None and sorted(order) == sorted(plan.conditions)
    ]
    return replace(plan, persons=(*plan.persons, *new))


def with_next_person(plan: Plan) -> Plan:
    """With one more participant, who takes the first order that nobody has who goes on."""
    taken = {person.slot for person in plan.persons if not person.dropped and person.slot is not None}
    slot = next(slot for slot in range(len(taken) + 1) if slot not in taken)
    numbers = [int(found[1]) for one in plan.persons if (found := re.fullmatch(r"P0*(\d{1,6})", one.id))]
    name = f"P{max(numbers, default=0) + 1:02d}"
    return replace(plan, persons=(*plan.persons, _person(plan, name, slot)))


def _person(plan: Plan, name: str, slot: int) -> Person:
    count = len(plan.conditions)
    order = assigned(count, slot + 1)[slot] if count > 1 else (0,)
    return Person(name, slot, tuple(Task(plan.conditions[index]) for index in order))


def full_round(plan: Plan) -> int:
    """How many participants make the orders balanced once."""
    return len(williams_design(len(plan.conditions))) if len(plan.conditions) > 1 else 1


def current(plan: Plan) -> tuple[Person, int] | None:
    """The participant and the index of the task that is next, or whose questionnaires are open; None without one."""
    for person in plan.persons:
        if not person.dropped:
            for index, task in enumerate(person.tasks):
                if task.state in ("todo", "now", "cut") or open_questionnaire(plan, task) is not None:
                    return person, index
    return None


def open_questionnaire(plan: Plan, task: Task) -> str | None:
    """The questionnaire to be filled in after a task that is done."""
    if task.state != "done":
        return None
    return next((name for name in plan.questionnaires if name not in task.submitted), None)


def missing_items(plan: Plan, task: Task, questionnaire: str) -> list[str]:
    """The items and pairs of a questionnaire that have no answer."""
    return [item for item in plan.wanted(questionnaire) if (questionnaire, item) not in task.answers]


# --- records


def after(plan: Plan, record: Record) -> Plan:
    """The plan after one more record. One that names nobody known, or is of no known type, changes nothing."""
    kind, name, condition = record.get("type"), record.get("participant"), record.get("condition")
    if kind == "participant" and isinstance(name, str):
        return _with_participant(plan, record, name)
    person = plan.person(str(name))
    if person is None:
        return plan
    if kind == "dropped":
        return _with(plan, replace(person, dropped=True, left_because=str(record.get("reason", ""))))
    for index, task in enumerate(person.tasks):
        if task.condition == condition:
            tasks = (*person.tasks[:index], _task_after(task, record), *person.tasks[index + 1 :])
            return _with(plan, replace(person, tasks=tasks, begun=True))
    return plan


def _with_participant(plan: Plan, record: Record, name: str) -> Plan:
    known, order = plan.person(name), record.get("order")
    if known is not None:
        return _with(plan, replace(known, begun=True))
    if not isinstance(order, list) or sorted(map(str, order)) != sorted(plan.conditions):
        return plan
    tasks = tuple(Task(str(condition)) for condition in order)
    return replace(plan, persons=(*plan.persons, Person(name, record.get("slot"), tasks, begun=True)))


def _with(plan: Plan, person: Person) -> Plan:
    return replace(plan, persons=tuple(person if one.id == person.id else one for one in plan.persons))


def _task_after(task: Task, record: Record) -> Task:
    change = _CHANGES.get(str(record.get("type")))
    return task if change is None else change(task, record)


_CHANGES: Mapping[str, Callable[[Task, Record], Task]] = {
    "begun": lambda task, _: replace(task, state="now", attempt=task.attempt + 1, trials=0),
    "finished": lambda task, record: replace(task, state="done", trials=int(record.get("trials", 0))),
    # What was answered was of the attempt that does not count.
    "set_aside": lambda task, _: replace(task, state="todo", trials=0, answers={}, submitted=frozenset()),
    "skipped": lambda task, _: replace(task, state="skipped"),
    "answer": lambda task, record: replace(
        task, answers={**task.answers, (str(record["questionnaire"]), str(record["item"])): int(record["value"])}
    ),
    "submitted": lambda task, record: replace(task, submitted=task.submitted | {str(record["questionnaire"])}),
    "left_open": lambda task, record: replace(task, submitted=task.submitted | {str(record["questionnaire"])}),
}


def with_logs(plan: Plan, logs: Iterable[FoundLog]) -> Plan:
    """The plan with what lies in the folder, which is more certain than any record: a log is there or it is not."""
    for log in logs:
        person = plan.person(log.participant)
        for task in person.tasks if person is not None else ():
            if task.condition == log.condition and person is not None:
                state: TaskState = "done" if log.whole else "cut"
                attempt = max(task.attempt, 1)
                found = replace(task, state=state, trials=log.trials, cut_s=log.seconds, attempt=attempt)
                plan = _with(plan, replace(person, tasks=tuple(found if one is task else one for one in person.tasks)))
    lost = [person for person in plan.persons if any(task.state == "now" for task in person.tasks)]
    for person in lost:  # begun, and no log of it was left
        tasks = tuple(replace(task, state="todo") if task.state == "now" else task for task in person.tasks)
        plan = _with(plan, replace(person, tasks=tasks))
    return plan


# --- tables


def participant_rows(plan: Plan) -> tuple[dict[str, str], ...]:
    """The rows of participants.csv: everybody who has begun, and whom the study's own table plans."""
    return tuple(
        {"participant": person.id, "sequence": "-".join(person.order)}
        for person in plan.persons
        if person.begun or person.slot is None
    )


def rating_rows(plan: Plan) -> tuple[dict[str, str], ...]:
    """The rows of questionnaires.csv: each answer that counts, and of pairs how often each item was chosen."""
    return tuple(
        {
            "participant": person.id,
            "condition": task.condition,
            "questionnaire": questionnaire,
            "scale": scale,
            "rating": str(rating),
        }
        for person in plan.persons
        for task in person.tasks
        for questionnaire, scale, rating in sorted((*_ratings(plan, task), *_weights(plan, task)))
    )


def _ratings(plan: Plan, task: Task) -> Iterator[tuple[str, str, int]]:
    for (questionnaire, item), value in task.answers.items():
        if item in plan.questionnaires.get(questionnaire, (item,)):
            yield questionnaire, item, value * _TLX_POINTS if questionnaire == "nasa_tlx" else value


def _weights(plan: Plan, task: Task) -> Iterator[tuple[str, str, int]]:
    """How often each item was chosen, once all pairs are answered: before that it would be another number."""
    for questionnaire, pairs in plan.pairs.items():
        given = [task.answers.get((questionnaire, pair_id(pair))) for pair in pairs]
        chosen = Counter(pair[value] for pair, value in zip(pairs, given, strict=True) if value is not None)
        if chosen.total() == len(pairs):
            yield from ((questionnaire, f"weight_{item}", chosen[item]) for item in plan.questionnaires[questionnaire])

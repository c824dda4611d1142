"""Who is next: balanced orders, drop-outs, attempts and answers, and that records alone say where a study stands."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from pipeline.live import plan
from pipeline.live.plan import FoundLog, Plan
from pipeline.statistics.counterbalancing import balance

EMPTY = Plan(("kinect", "window", "fusion"), {"nasa_tlx": ("mental", "effort")})


def played(given: Plan, condition: str = "", **changes: object) -> Plan:
    """The plan once the next participant has done all their tasks and questionnaires."""
    known = plan.with_next_person(given) if plan.current(given) is None else given
    now = plan.current(known)
    assert now is not None
    person = now[0]
    known = plan.after(
        known, {"type": "participant", "participant": person.id, "order": list(person.order), "slot": person.slot}
    )
    for name in person.order:
        for record in ("begun", "finished"):
            known = plan.after(known, {"type": record, "participant": person.id, "condition": name, "trials": 6})
        known = plan.after(
            known, {"type": "submitted", "participant": person.id, "condition": name, "questionnaire": "nasa_tlx"}
        )
    return known


@given(st.lists(st.booleans(), min_size=6, max_size=40))
def test_orders_are_balanced_whoever_drops_out(stays: list[bool]) -> None:
    known = EMPTY
    for goes_on in [*stays, *[True] * 6]:
        known = plan.with_next_person(known)
        if goes_on:
            known = played(known)
        else:
            known = plan.after(known, {"type": "dropped", "participant": known.persons[-1].id})
    orders = [person.order for person in known.persons if not person.dropped]
    assert len(orders) == sum(stays) + 6
    whole = orders[: len(orders) // 6 * 6]
    least, most = balance(orders).period
    assert most - least <= 1  # in every period, however many there are
    assert balance(whole).complete or any(not one for one in stays)
    slots = sorted(person.slot for person in known.persons if not person.dropped and person.slot is not None)
    assert slots == list(range(len(orders)))  # the orders of the first participants, each once


def test_the_study_s_own_table_says_the_order_and_others_follow() -> None:
    known = plan.planned(EMPTY, [("A", ("fusion", "kinect", "window")), ("B", ("fusion", "kinect"))])
    assert [person.id for person in known.persons] == ["A"]  # an order that lacks a condition is none
    assert plan.with_next_person(played(known)).persons[-1].id == "P01"


def test_what_is_set_aside_takes_its_answers_along() -> None:
    known = plan.with_next_person(EMPTY)
    ids = {"participant": "P01", "condition": "kinect"}
    for record in (
        {"type": "begun", **ids},
        {"type": "finished", **ids, "trials": 6},
        {"type": "answer", **ids, "questionnaire": "nasa_tlx", "item": "mental", "value": 7},
    ):
        known = plan.after(known, record)
    assert plan.rating_rows(known)[0]["rating"] == "35"  # of 100
    known = plan.after(known, {"type": "set_aside", **ids})
    assert plan.rating_rows(known) == ()
    now = plan.current(known)
    assert now is not None
    assert now[0].tasks[now[1]].attempt == 1
    assert plan.current(plan.after(known, {"type": "begun", **ids})) is not None


def test_a_log_in_the_folder_is_more_certain_than_a_record() -> None:
    known = plan.with_next_person(EMPTY)
    known = plan.after(known, {"type": "begun", "participant": "P01", "condition": "kinect"})
    cut = plan.with_logs(known, [FoundLog("P01", "kinect", False, 4, 31.2)])
    assert (cut.persons[0].tasks[0].state, cut.persons[0].tasks[0].trials) == ("cut", 4)
    assert plan.with_logs(known, []).persons[0].tasks[0].state == "todo"
    assert plan.with_logs(known, [FoundLog("P01", "kinect", True, 6, 60.0)]).persons[0].tasks[0].state == "done"


@given(
    st.lists(
        st.dictionaries(
            st.sampled_from(["type", "participant", "condition", "order", "slot"]),
            st.text() | st.none() | st.integers() | st.just("P01") | st.just("begun") | st.just("kinect"),
        )
    )
)
def test_records_that_are_none_change_nothing_that_counts(records: list[dict[str, object]]) -> None:
    known = plan.with_next_person(EMPTY)
    for record in records:
        known = plan.after(known, record)
    assert known.persons[0].id == "P01"
    assert sorted(known.persons[0].order) == sorted(EMPTY.conditions)

"""The questionnaire's page: an answer is saved when it is given, a page is handed in when all are."""

from __future__ import annotations

from pipeline.live import plan
from pipeline.live.events import Said, Tell
from pipeline.live.messages import Answer, Submit
from pipeline.live.outgoing import AnswerSaved, Refused
from pipeline.live.run_state import Stepped, StudyRun, form, save, settled, tables, tell_everybody
from pipeline.study.recording import pair_id


def answered(run: StudyRun, event: Said, answer: Answer) -> Stepped:
    """An answer, if its questionnaire is open; the page is told when it is on the disk."""
    now = run.now
    known = next((one for one in run.setup.recording.questionnaires if one.id == answer.questionnaire), None)
    largest = {} if known is None else {one.id: one.steps for one in known.items}
    largest |= {} if known is None else {pair_id(pair): 1 for pair in known.pairs}
    fits = answer.item in largest and answer.value <= largest[answer.item]
    if now is None or run.phase != "questionnaire" or known is None or not fits:
        return run, (Tell(event.client, Refused(answer.id, "This questionnaire is not open.")),)
    person, index = now
    if plan.open_questionnaire(run.plan, person.tasks[index]) != known.id:
        return run, (Tell(event.client, Refused(answer.id, "This questionnaire is not open.")),)
    record = {
        "type": "answer",
        "participant": person.id,
        "condition": person.tasks[index].condition,
        "questionnaire": known.id,
        "item": answer.item,
        "value": answer.value,
        "at_ns": event.at_ns,
    }
    return save(run, record, event.client, answer.id)


def submitted(run: StudyRun, event: Said, submit: Submit) -> Stepped:
    """A page handed in, if nothing on it is missing; then the next task, or the next page, is open."""
    now = run.now
    if now is None or run.phase != "questionnaire":
        return run, (Tell(event.client, AnswerSaved(submit.id)),)
    person, index = now
    task = person.tasks[index]
    if plan.open_questionnaire(run.plan, task) != submit.questionnaire:
        return run, (Tell(event.client, AnswerSaved(submit.id)), Tell(event.client, form(run)))
    missing = plan.missing_items(run.plan, task, submit.questionnaire)
    if missing:
        return run, (Tell(event.client, Refused(submit.id, f"Not answered yet: {', '.join(missing)}.")),)
    record = {"type": "submitted", "participant": person.id, "condition": task.condition, "at_ns": event.at_ns}
    run, saved = save(run, {**record, "questionnaire": submit.questionnaire}, event.client, submit.id)
    run = settled(run)
    return run, (*saved, *tables(run), *tell_everybody(run))

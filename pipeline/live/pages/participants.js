// Who does what, in which order, and how far it is: a table on the screen, and one for paper.

import { filled, taskName } from "./texts.js";

function cell(tag, text, className = "") {
  return Object.assign(document.createElement(tag), { textContent: text, className });
}

function head(texts, most) {
  const row = document.createElement("tr");
  const names = [texts.participant, ...Array.from({ length: most }, (_, i) => filled(texts.common.task, { number: i + 1 }))];
  row.append(...names.map((name) => Object.assign(cell("th", name), { scope: "col" })));
  const made = document.createElement("thead");
  made.append(row);
  return made;
}

function table(place, texts, participants, makeCell) {
  const most = Math.max(0, ...participants.map(({ tasks }) => tasks.length));
  const body = document.createElement("tbody");
  for (const person of participants) {
    const row = document.createElement("tr");
    const name = person.dropped ? `${person.id} (${texts.dropped})` : person.id;
    row.append(Object.assign(cell("th", name), { scope: "row" }), ...person.tasks.map(makeCell));
    body.append(row);
  }
  place.replaceChildren(head(texts, most), body);
}

export function showParticipants(place, texts, participants) {
  table(place, texts, participants, (task) => {
    const made = cell("td", texts.task_state[task.state], task.state);
    for (const line of lines(texts, task)) made.append(cell("small", line));
    return made;
  });
}

function lines(texts, task) {
  const begun = !["todo", "skipped"].includes(task.state);
  const forms = task.questionnaires.filter(() => begun);
  return [
    task.condition,
    begun ? filled(texts.trials, task) : null,
    task.attempt > 1 ? filled(texts.attempt, task) : null,
    ...forms.map((form) => filled(form.submitted ? texts.submitted : texts.questionnaire, form)),
  ].filter(Boolean);
}

// For paper: which task comes when, with room to write; a blind operator's sheet is blind too.
export function showSheet(place, texts, participants) {
  table(place, texts, participants, (task) => cell("td", task.condition ?? taskName(texts, task.label)));
}

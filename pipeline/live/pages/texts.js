// The words of a page, in the browser's language where there is a file for it, else in English.

const NAME = /^[a-z]{2,3}$/;

async function fetched(language) {
  const answer = await fetch(`/pages/texts/${language}.json`);
  return answer.ok ? JSON.parse(await answer.text(), bare) : null;
}

// Ids of a study are looked up in these texts, and one may be called "constructor".
function bare(_, value) {
  return value && typeof value === "object" ? Object.assign(Object.create(null), value) : value;
}

// { common, <page> } of the first language that there is, and the document marked with it.
export async function loadTexts(page) {
  const wanted = [new URLSearchParams(location.search).get("lang"), ...navigator.languages];
  const languages = wanted.filter(Boolean).map((one) => one.toLowerCase().split("-")[0]);
  for (const language of new Set([...languages, "en"])) {
    const texts = NAME.test(language) ? await fetched(language) : null;
    if (!texts) continue;
    document.documentElement.lang = language;
    document.title = `${texts[page].title} – Steadyhand`;
    fill(document, texts[page]);
    return { common: texts.common, ...texts[page] };
  }
  throw new Error("the texts of this page could not be loaded");
}

// Every element that names its text gets it.
export function fill(root, texts) {
  const named = (path) => path.split(".").reduce((part, key) => part[key], texts);
  for (const one of root.querySelectorAll("[data-text]")) one.textContent = named(one.dataset.text);
  for (const one of root.querySelectorAll("[data-label]")) one.setAttribute("aria-label", named(one.dataset.label));
}

// "Target {number} of {of}" with its values.
export function filled(template, values) {
  return template.replace(/\{(\w+)\}/g, (_, name) => values[name]);
}

// "Task 2", as the server says it, in the page's language.
export function taskName(texts, task) {
  const number = /\d+$/.exec(task);
  return number ? filled(texts.common.task, { number: number[0] }) : task;
}

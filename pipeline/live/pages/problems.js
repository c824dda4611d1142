// What this browser lacks for the study, and the way out of each, in the page's words.

// Names of what is wrong, the worst first. Without a secure connection there are no sensors, whatever else is said of them.
export function problems({ permission, wakeLock }) {
  const sensors = isSecureContext ? { denied: "denied", unavailable: "unavailable" }[permission] : "insecure";
  return [sensors, wakeLock ? null : "no_wake_lock"].filter(Boolean);
}

// A list of what is wrong, each with its remedy; the button says what is left when one goes on without.
export function showProblems(list, button, found, texts) {
  const words = found.flatMap((name) => [["dt", name], ["dd", `${name}_remedy`]]);
  const made = words.map(([tag, name]) => Object.assign(document.createElement(tag), { textContent: texts.problem[name] }));
  list.replaceChildren(...made);
  button.textContent = found[0] === "no_wake_lock" ? texts.problem.go_on : texts.problem.display_only;
}

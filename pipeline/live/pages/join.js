// Where a scanned code leads: the key becomes a cookie, and the phone or the questionnaire opens.

import { exchangeKey } from "./key.js";
import { loadTexts } from "./texts.js";

const texts = await loadTexts("join");
const [status, again] = ["status", "again"].map((id) => document.getElementById(id));

async function join() {
  again.hidden = true;
  status.textContent = texts.joining;
  const { go, why } = await exchangeKey();
  if (go) location.replace(new URL(go, location.origin).pathname + location.search);
  else status.textContent = texts.failed[why];
  again.hidden = why !== "no_answer";
}

again.addEventListener("click", join);
join();

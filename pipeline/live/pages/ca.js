// How a phone comes to trust this computer's certificate: the steps are words, the certificate is the server's.

import { fill, loadTexts } from "./texts.js";

const texts = await loadTexts("ca");
const at = (id) => document.getElementById(id);
fill(document, texts);

const answer = await fetch("/ca.json");
const { fingerprint } = await answer.json();
at("get").href = "/ca.crt";
at("fingerprint").textContent = fingerprint ?? "";
at("made").hidden = !fingerprint;
at("none").hidden = Boolean(fingerprint);

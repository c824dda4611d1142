// The key in an address (#k=…) is exchanged for a cookie once, and leaves the address so that nobody reads it off the screen.

// { go } where the server took the key, { why } where it did not ("no_key", "refused", "no_answer").
export async function exchangeKey() {
  const key = new URLSearchParams(location.hash.slice(1)).get("k");
  if (!key) return { why: "no_key" };
  try {
    const answer = await fetch("/join", {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ k: key }),
    });
    history.replaceState(null, "", location.pathname + location.search);
    return answer.ok ? await answer.json() : { why: "refused" };
  } catch {
    return { why: "no_answer" }; // the key stays in the address, for another try
  }
}

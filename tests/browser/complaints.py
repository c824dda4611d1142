"""What a browser said about a page that a page should not give cause for."""

from __future__ import annotations

from tests.browser.chromium import Event


def complaint(event: Event, ours: tuple[str, ...]) -> str | None:
    """An exception, an error or warning, or a request for an address that begins with none of `ours`; else None."""
    method, said = event.get("method"), event.get("params", {})
    if method == "Runtime.exceptionThrown":
        return f"an exception: {said['exceptionDetails'].get('exception', {}).get('description')}"
    if method == "Runtime.consoleAPICalled" and said["type"] in ("error", "warning"):
        return f"the console: {[one.get('value') for one in said['args']]}"
    if method == "Log.entryAdded" and said["entry"]["level"] in ("error", "warning"):
        return f"the log: {said['entry']['text']}"
    if method == "Network.requestWillBeSent" and not said["request"]["url"].startswith(ours):
        return f"a request leaves: {said['request']['url'][:200]}"
    return None

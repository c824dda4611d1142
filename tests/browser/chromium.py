"""Headless Chromium by the DevTools protocol over a pipe: no driver, no socket, no further package."""

from __future__ import annotations

import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

_NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
_PATIENCE_S = 60.0
_FLAGS = (
    "--headless",
    "--remote-debugging-pipe",
    "--disable-gpu",
    "--hide-scrollbars",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-dev-shm-usage",
)
Event = dict[str, Any]


class BrowserError(Exception):
    """The browser is not there, does not answer, or says that a command failed."""


def found() -> str:
    """The browser's program. BrowserError, with the way to it, where there is none."""
    for name in _NAMES:
        path = shutil.which(name)
        if path:
            return path
    raise BrowserError("there is no Chromium here; on Debian and Ubuntu: sudo apt install chromium")


class _Pipe:
    """The browser's commands and what it says, of all pages."""

    def __init__(self, write: int, read: int) -> None:
        self._write, self._read, self._buffer, self._count = write, read, b"", 0
        self.tabs: dict[str | None, Tab] = {}

    def send(self, method: str, parameters: Event, session: str | None) -> int:
        """Send a command; its number."""
        self._count += 1
        message: Event = {"id": self._count, "method": method, "params": parameters}
        if session is not None:
            message["sessionId"] = session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        return self._count

    def next(self, deadline: float) -> Event:
        """What the browser says next. BrowserError where it says nothing until then."""
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._read], [], [], max(deadline - time.monotonic(), 0))
            part = os.read(self._read, 1 << 20) if ready else b""
            if not part:
                raise BrowserError("the browser stopped, or did not answer in time")
            self._buffer += part
        text, _, self._buffer = self._buffer.partition(b"\0")
        event: Event = json.loads(text)
        return event


class Tab:
    """One page. What it asks for and complains of is gathered in `events`."""

    def __init__(self, pipe: _Pipe, session: str | None = None) -> None:
        self._pipe, self._session = pipe, session
        self.events: list[Event] = []
        pipe.tabs[session] = self

    def call(self, method: str, **parameters: Any) -> Any:
        """A command's answer."""
        number = self._pipe.send(method, parameters, self._session)
        answer = self._until(lambda event: event.get("id") == number)
        if "error" in answer:
            raise BrowserError(f"{method}: {answer['error']['message']}")
        return answer["result"]

    def open(self, address: str) -> None:
        """Load a page, and forget what an earlier one said."""
        self.events.clear()
        self.call("Page.navigate", url=address)
        self._until(lambda event: event.get("method") == "Page.loadEventFired")

    def reload(self) -> None:
        """Load the page anew; what it said before is kept."""
        self.call("Page.reload")
        self._until(lambda event: event.get("method") == "Page.loadEventFired")

    def evaluate(self, script: str) -> Any:
        """The value of an expression in the page, awaited; plain data."""
        answer = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            raise BrowserError(answer["exceptionDetails"].get("exception", {}).get("description", "a script failed"))
        return answer["result"].get("value")

    def another(self) -> Tab:
        """One more page of the same browser, in a window of its own: what is behind others may not be drawn."""
        target = self.call("Target.createTarget", url="about:blank", newWindow=True)["targetId"]
        return _attached(self._pipe, self, target)

    def _until(self, wanted: Callable[[Event], bool]) -> Event:
        deadline = time.monotonic() + _PATIENCE_S
        while True:
            event = self._pipe.next(deadline)
            owner = self._pipe.tabs.get(event.get("sessionId"), self)
            if owner is self and wanted(event):
                return event
            owner.events.append(event)


@contextmanager
def tab(*flags: str) -> Iterator[Tab]:
    """A browser of its own with one page, gone afterwards; `flags` for its command line besides."""
    to_browser, ours_out = os.pipe()
    ours_in, from_browser = os.pipe()
    sandbox = ("--no-sandbox",) if os.geteuid() == 0 else ()  # root has no other way
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        words = [found(), *_FLAGS, *flags, *sandbox, f"--user-data-dir={profile}", "about:blank"]
        # The browser reads from descriptor 3 and writes to 4. The shell is handed the pipes as its input and output,
        # because some shells take no descriptor above 9 by its number.
        process = subprocess.Popen(
            ["/bin/sh", "-c", 'exec "$@" 3<&0 4>&1 </dev/null >/dev/null', "sh", *words],
            stdin=to_browser,
            stdout=from_browser,
            stderr=subprocess.DEVNULL,
            cwd=Path(profile),
        )
        os.close(to_browser)
        os.close(from_browser)
        try:
            yield Tab(_Pipe(ours_out, ours_in)).another()
        finally:
            os.close(ours_out)
            process.terminate()
            process.wait(10)
            os.close(ours_in)


def _attached(pipe: _Pipe, opener: Tab, target: str) -> Tab:
    session = opener.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
    opened = Tab(pipe, session)
    for domain in ("Page", "Runtime", "Network", "Log"):
        opened.call(f"{domain}.enable")
    return opened

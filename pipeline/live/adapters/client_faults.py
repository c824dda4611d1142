"""Why there is no connection to a server of readings, in words that continue its url, and what to do."""

from __future__ import annotations

import os
import ssl
from collections.abc import Callable, Sequence
from typing import Any

from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidStatus, InvalidURI

_TOO_LONG = 1009  # the WebSocket's code for a frame over the limit
_NETWORK = "see whether it runs, and the network"


def why(error: Exception, longest: int) -> str:
    """Why: `longest` is the longest frame that was allowed, in bytes."""
    return next(words(error, longest) for kind, words in _WORDS if isinstance(error, kind))


def _closed(error: ConnectionClosed, longest: int) -> str:
    if error.sent is not None and error.sent.code == _TOO_LONG:
        return f"sent a frame of over {longest // 1024} KiB, which no sensor's is; name another topic."
    return f"has closed the connection, or does not answer any more; {_NETWORK}."


def _system(error: OSError, _: int) -> str:
    reason = os.strerror(error.errno) if error.errno and error.errno > 0 else error.strerror or error
    return f"cannot be connected to ({reason}); start the server, or correct the url."


_WORDS: Sequence[tuple[type[Exception], Callable[[Any, int], str]]] = (
    (ConnectionClosed, _closed),
    (InvalidStatus, lambda e, _: f"answers with HTTP {e.response.status_code} and no WebSocket; correct the url."),
    (InvalidURI, lambda *_: "is no address of a WebSocket; write ws://HOST:PORT."),
    (InvalidHandshake, lambda *_: "answers, but not as a WebSocket; correct the url."),
    (ssl.SSLError, lambda e, _: f"has a certificate that is not trusted here ({e.reason}); write ws://, or trust it."),
    (TimeoutError, lambda *_: f"does not answer; {_NETWORK}."),
    (Exception, _system),
)

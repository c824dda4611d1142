"""Messages about a run: what happened to sessions and to the cache, and what was computed."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.engine.result import Result
from pipeline.words.phrases import one_line


def session_messages(result: Result) -> Iterator[str]:
    """A line for each session that is set aside or read in part, and for each file that is not used."""
    for session, reason in result.set_aside:
        yield one_line(f"{result.name}: session {session.id} set aside: {reason}")
    for session, reason in result.in_part:
        yield one_line(f"{result.name}: session {session.id} read in part: {reason}")
    for name, reason in result.unused:
        yield one_line(f"{result.name}: {name} not used: {reason}")


def damage_messages(result: Result) -> Iterator[str]:
    """A line for each entry of the cache that was damaged."""
    for stage, session, damage in result.damaged:
        which = f'"{stage}" of session {session}' if session else f'"{stage}"'
        said = f"{result.name}: the cached result of stage {which} was damaged ({damage}) and has been computed again"
        yield one_line(said)


def computed_message(result: Result) -> str:
    """How many pieces of each stage were computed, and how long the run took."""
    counts = [f"{stage} {count}" for stage, count in result.computed.items() if count]
    if not counts:
        return f"Nothing had changed, so nothing was computed again ({result.seconds:.1f} s)."
    return f"Computed: {', '.join(counts)} ({result.seconds:.1f} s)."

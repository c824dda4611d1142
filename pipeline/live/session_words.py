"""What an attempt writes into its log besides readings, and what it says to the phone."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.live.events import Actions, Tell, Write
from pipeline.live.outgoing import PhaseOfTask, Say, Selected
from pipeline.live.session_state import Session, Stepped
from pipeline.sessions.logs.mcap import Message

NOTES, DRAWN = "/recorder/notes", "/display/drawn"


def event_of(state: Session, at_ns: int, **event: object) -> Write:
    """An event of the study, for the log."""
    return Write(Message(state.attempt.events_topic, "events", at_ns, at_ns, event=event))


def note(state: Session, at_ns: int, kind: str, text: str) -> Stepped:
    """A note in the log."""
    return state, (record(NOTES, at_ns, {"type": kind, "text": text}),)


def record(topic: str, at_ns: int, content: Mapping[str, object]) -> Write:
    """A record of the recorder's own, for the log."""
    return Write(Message(topic, "anything", at_ns, at_ns, event=content))


def tell_phase(state: Session) -> Actions:
    """The phone learns where the task stands."""
    seconds = float(state.seconds_left) if state.phase == "countdown" else None
    numbered = state.phase in ("practice", "running")
    phase = PhaseOfTask(
        state.phase,  # type: ignore[arg-type]
        state.trial if numbered else None,
        state.target if numbered else None,
        seconds,
    )
    return to_phone(state, phase)


def to_phone(state: Session, message: PhaseOfTask | Selected | Say) -> Actions:
    """To the phone, if there is one."""
    return () if state.phone is None else (Tell(state.phone, message),)

"""Whether the active phone is still there, as far as its connection does not say: it may sleep, or be out of reach.

Its page asks for the time four times a second, whatever is shown, so its silence is no accident. Until it has asked
once nothing is concluded. What its page says of itself beside that, being hidden and its battery, is kept here too.
"""

from __future__ import annotations

from pipeline.live import session_state
from pipeline.live.changes import changed
from pipeline.live.events import NOTHING, Said
from pipeline.live.messages import Battery, Ping, Visible
from pipeline.live.run_state import Stepped, StudyRun, to_attempt

_SILENT_NS = 1_000_000_000  # several times what a network needs now and then


def heard(run: StudyRun, event: Said) -> Stepped:
    """The active phone has sent something: it is there, and back if it was away."""
    if run.heard_ns is None and not isinstance(event.message, Ping):
        return run, NOTHING
    was_away = run.is_away
    run = changed(run, heard_ns=event.at_ns, is_away=False)
    return to_attempt(run, session_state.PhoneIs(run.phone, event.at_ns)) if was_away else (run, NOTHING)


def missed(run: StudyRun, at_ns: int) -> Stepped:
    """Time has passed: a phone that has been silent for a second is away, for as long as it is silent."""
    if run.phone is None or run.is_away or run.heard_ns is None or at_ns - run.heard_ns < _SILENT_NS:
        return run, NOTHING
    return to_attempt(changed(run, is_away=True), session_state.PhoneIs(None, at_ns, run.heard_ns))


def hidden(run: StudyRun, event: Said, message: Visible) -> Stepped:
    """The page is not seen any more, or again: the log notes it."""
    run = changed(run, is_hidden=not message.visible)
    kind = "phone_visible" if message.visible else "phone_hidden"
    return to_attempt(run, session_state.Noted("", event.at_ns, kind))


def charged(run: StudyRun, event: Said, message: Battery) -> Stepped:
    """How full its battery is."""
    return changed(run, battery=message.level), NOTHING

"""The lights and traces of the operator's page, read off the state of a run. Pure."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.live import desk, health, messages
from pipeline.live.outgoing import Whole
from pipeline.live.run_state import StudyRun

_NS_PER_MS = 1e6
_NS_PER_S = 1e9
_LATE_WRITE_MS = 2_000.0
_LATELY_NS = 10_000_000_000
_LOW_BATTERY = 0.2
_NO_MOTION = ("denied", "unavailable")
_UNKNOWN = "its orientation is not known yet: hold it still, then move it."


def lights(run: StudyRun, at_ns: int) -> Whole:
    """The lights and traces."""
    attempt = run.attempt
    found: dict[str, object] = {}
    for name, one in run.health.items():
        lost = attempt.heard[name].lost if attempt is not None else 0
        light = health.light(one, at_ns, lost)
        problem = run.links.get(name) or (None if one.count else _not_yet(run, name))
        if (
            name == run.setup.turned_stream != run.setup.motion_stream
            and desk.is_unaligned(run)
            and light["light"] == "green"
        ):
            light = {**light, "light": "amber", "text": f"{light['text']}; {_UNKNOWN}"}
        found[name] = {**light, "light": "red", "text": problem} if problem else light
    found |= {
        "senders": _senders_light(run, at_ns),
        "phone": _phone_light(run),
        "clock": _clock_light(run),
        "disk": _disk_light(run),
        "log": _log_light(run),
    }
    mapping = run.clock.mapping
    return Whole(
        "lights",
        {
            "lights": found,
            "drawn_hz": float(len(run.drawn)),
            "round_trip_ms": None if mapping is None else round(2 * mapping.uncertainty_ms, 2),
            "traces": {
                "t_s": [round((at - at_ns) / _NS_PER_S, 2) for at, _, _ in run.traces],
                "raw_mm": [raw for _, raw, _ in run.traces],
                "shown_mm": [shown for _, _, shown in run.traces],
            },
        },
    )


def _not_yet(run: StudyRun, name: str) -> str | None:
    """What is said of a sender by UDP of which nothing has come, as a firewall or a wrong address leave it."""
    port = run.setup.recording.senders[name].port
    return None if port is None else f"Nothing has come to UDP port {port}: see the sender's address, and the firewall."


def _senders_light(run: StudyRun, at_ns: int) -> dict[str, object]:
    """What was sent and not taken: amber for ten seconds after each."""
    dropped = run.dropped
    if dropped is None:
        return {"light": "off", "text": "Nothing was dropped."}
    counted = ", ".join(f"{reason} ({count})" for reason, count in sorted(dropped.counts.items()))
    lately = at_ns - dropped.at_ns < _LATELY_NS
    return {"light": "amber" if lately else "green", "text": f"Not taken: {counted}."}


def _phone_light(run: StudyRun) -> dict[str, object]:
    light, text = next(_of_phone(run), ("green", "Connected."))
    return {"light": light, "text": text}


def _of_phone(run: StudyRun) -> Iterator[tuple[str, str]]:
    """What there is to say of the phone, the worst first."""
    hello, sends_motion = run.hello, run.setup.motion_stream is not None
    if run.phone is None:
        yield "red", "No phone is connected. Scan the code with the phone."
    if run.is_away or run.is_hidden:
        yield "red", "Connected; its page is not in view or out of reach: wake the phone up."
    if hello is not None and hello.version != messages.VERSION:
        yield "red", "Connected; its page is of another version of Steadyhand: load it anew."
    if sends_motion and hello is not None and hello.permission in _NO_MOTION:
        yield "red", "Connected; it gives no motion: see its page."
    if run.battery is not None and run.battery < _LOW_BATTERY:
        yield "amber", f"Connected; its battery is at {run.battery:.0%}: plug it in."
    if hello is not None and not hello.wake_lock and not run.setup.mouse:
        yield "amber", "Connected; its screen may go dark: set its automatic lock to “never”."
    if sends_motion and desk.is_unaligned(run):
        yield "amber", f"Connected; {_UNKNOWN}"


def _clock_light(run: StudyRun) -> dict[str, object]:
    """How well the phone's clock is known; amber where that of any sender was set."""
    mapping = run.clock.mapping
    were_set = ", ".join(name for name, one in run.one_way.items() if one.steps)
    if were_set and not run.clock.steps:
        return {"light": "amber", "text": f"The clock of the sender of {were_set} was set; it is known anew."}
    if mapping is None:
        return {"light": "off" if run.phone is None else "amber", "text": "The phone's clock is not known yet."}
    text = f"Known to ± {mapping.uncertainty_ms:.1f} ms."
    if run.clock.steps:
        return {
            "light": "amber",
            "text": f"{text} It was set {'once' if run.clock.steps == 1 else f'{run.clock.steps} times'}.",
        }
    return {"light": "green" if mapping.uncertainty_ms < 10 else "amber", "text": text}


def _disk_light(run: StudyRun) -> dict[str, object]:
    if run.disk is None:
        return {"light": "off", "text": ""}
    if run.disk.fault is not None:
        return {"light": "red", "text": run.disk.fault}
    free = f"{run.disk.free_bytes / 1e9:.1f} GB free."
    return {"light": "green" if run.disk.free_bytes >= desk.LEAST_FREE_BYTES else "red", "text": free}


def _log_light(run: StudyRun) -> dict[str, object]:
    known = desk.open_log(run)
    if known is None or run.disk is None or run.disk.log_bytes is None:
        return {"light": "off", "text": "No log is open."}
    written = 0.0 if run.disk.written_ns is None else (run.disk.at_ns - run.disk.written_ns) / _NS_PER_MS
    text = f"{run.disk.log_bytes / 1e6:.1f} MB, written {written / 1e3:.1f} s ago."
    return {"light": "green" if written < _LATE_WRITE_MS else "red", "text": text}


def trace(run: StudyRun, at_ns: int) -> tuple[int, float | None, float | None]:
    """A point of the traces: time, and x in mm as the tracker has it and as it is shown."""
    attempt = run.attempt
    if attempt is None:
        return at_ns, None, None
    heard = attempt.heard.get(run.setup.tracker or "")
    raw = heard.last[0] * 1e3 if heard is not None and heard.last else None
    shown = attempt.sent[-1].mean_mm[list(attempt.attempt.axes).index("x")] if attempt.sent else None
    return at_ns, raw, shown

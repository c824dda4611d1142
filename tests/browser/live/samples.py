"""What the live study's server says in these tests: a task, a form, the operator's state."""

from __future__ import annotations

import math
from typing import Any

Message = dict[str, Any]
TLX = ("mental", "physical", "temporal", "performance", "effort", "frustration")
HOSTILE = "<img src=x onerror=alert(1)><b>bold</b>"


def welcome(**other: Any) -> Message:
    """The first task of three: a straight line and a corner, two targets."""
    return {
        "type": "welcome",
        "task": "Task 1",
        "of": 3,
        "px_per_mm": 10,
        "window_mm": [85.4, 48],
        "canvas_x_mm": [-1000, 1000],
        "canvas_y_mm": [0, 1000],
        "path_mm": [[-800, 500], [-300, 500], [-300, 700]],
        "targets_mm": [[-550, 500], [-300, 650]],
        "target_diameter_mm": 20,
        "button": {"side": "right", "mm": 12},
        "confirm_ms": 150,
        "mouse": False,
    } | other


def running(state: str = "running", target: int = 0) -> Message:
    """A state in which the button works."""
    return {"type": "state", "state": state, "trial": 1, "target": target, "seconds_left": None}


def show(n: int, x: float = -550.0, y: float = 500.0) -> Message:
    """An estimate."""
    return {"type": "show", "n": n, "x": x, "y": y, "trial": 1}


def form(with_pairs: bool = False, **values: int) -> Message:
    """The NASA-TLX, with the answers so far."""
    items = [
        {"id": item, "text": None, "low": None, "high": None, "steps": 20, "value": values.get(item)} for item in TLX
    ]
    pairs = [
        {"id": f"{first}-{second}", "first": first, "second": second, "value": None}
        for i, first in enumerate(TLX)
        for second in TLX[i + 1 :]
    ]
    return {
        "type": "form",
        "questionnaire": "nasa_tlx",
        "task": "Task 1",
        "title": None,
        "items": items,
        "pairs": pairs if with_pairs else [],
        "page": 1,
        "of": 1,
    }


def own_form() -> Message:
    """A lab's own questionnaire with five marks, whose words are as bad as words can be."""
    item = {"id": "arm", "text": HOSTILE, "low": "not at all", "high": HOSTILE, "steps": 4, "value": None}
    return form() | {"questionnaire": "comfort", "title": HOSTILE, "items": [item], "page": 2, "of": 2}


def _task(number: int, condition: str, state: str, trials: int = 0, answered: int = 0) -> Message:
    return {
        "task": number,
        "label": f"Task {number}",
        "condition": condition,
        "state": state,
        "attempt": 0 if state == "todo" else 1,
        "trials": trials,
        "of": 6,
        "questionnaires": [{"id": "nasa_tlx", "answered": answered, "of": 6, "submitted": answered == 6}],
    }


def state(**other: Any) -> Message:
    """A study of twelve people whose first is in the second task."""
    first = {
        "id": "P01",
        "dropped": False,
        "tasks": [_task(1, "a", "done", 6, 6), _task(2, "b", "now", 2), _task(3, "c", "todo")],
    }
    rest = [
        {"id": f"P{i:02}", "dropped": i == 2, "tasks": [_task(k + 1, "bca"[k], "todo") for k in range(3)]}
        for i in range(2, 13)
    ]
    return {
        "type": "state",
        "study": f"Peephole {HOSTILE}",
        "read_only": False,
        "demo": False,
        "participants": [first, *rest],
        "phase": "running",
        "next": {"do": "abort", "label": "Abort Task 2 of P01", "others": ["note", "swap"]},
        "now": {
            "participant": "P01",
            "task": 2,
            "attempt": 1,
            "trial": 3,
            "target": 2,
            "seconds": 14.2,
            "seconds_left": None,
        },
        "checks": [
            {"id": "still", "light": "green", "text": "9.80 m/s², noise 0.04"},
            {"id": "sweep", "light": "off", "text": "Sweep the phone left and right for ten seconds."},
        ],
        "log": {"file": "data/P01_b.mcap.part", "bytes": 12_400_000, "written_ms": 200},
        "disk_free_bytes": 120_000_000_000,
        "agreement": {"mm": 1.2e-12, "n": 5012, "file": "data/P01_a.mcap"},
        "links": [{"role": "phone", "url": "https://192.168.1.5:8443/join#k=k7Qm", "qr": "/qr/phone.svg"}],
        "phones": 1,
        "questionnaires_open": 0,
        "offers": [],
        "problems": [f"P02, task 1 was cut after 31.2 s {HOSTILE}"],
    } | other


def ready(light: str) -> Message:
    """A task may begin, with a check of this light."""
    return state(
        phase="ready",
        next={"do": "start", "label": "Start Task 1 of P01", "others": ["note", "skip"]},
        checks=[{"id": "still", "light": light, "text": "Hold the phone still for two seconds."}],
    )


def offering(accepted: str | None = None) -> Message:
    """A sender without a key sends for a stream, whose names are as bad as names can be."""
    offer = {"id": "tracker 192.168.1.7", "stream": "tracker", "source": "192.168.1.7", "sends": f"/hand {HOSTILE}"}
    return ready("green") | {"offers": [{**offer, "rate_hz": 30, "accepted": accepted}]}


def lights(phone: str = "green") -> Message:
    """Lights and traces."""
    t_s = [round(-5.9 + 0.1 * i, 1) for i in range(60)]
    shown = [None if t < -5 else -548 + 60 * math.sin(t) for t in t_s]
    return {
        "type": "lights",
        "lights": {
            "tracker": {"light": "green", "text": "30.1 Hz, gap 35 ms, 102 ms late"},
            "phone": {"light": phone, "text": "Scan the code with the phone."},
            "clock": {"light": "amber", "text": "Known to 6 ms."},
            "log": {"light": "off", "text": "No log is open."},
        },
        "drawn_hz": 59.8,
        "round_trip_ms": None,
        "traces": {"t_s": t_s, "raw_mm": [-548.0] * 60, "shown_mm": shown},
    }

"""Runs what is asked of the live study's pages, each case with a browser and a server of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from tests.browser.chromium import BrowserError, Tab, tab
from tests.browser.live import by_sensors, by_tls, operator, phone, phone_breaks, played, questionnaire, whole_study
from tests.browser.live.acts import fake_sensors
from tests.browser.live.looks import SCENES
from tests.browser.live.looks import faults as looks_faults
from tests.browser.live.server import LiveServer, live_server

Case = Callable[[Tab, LiveServer], None]
WHOLE: dict[str, Callable[[], None]] = {
    "study: by sensors and touch": by_sensors.plays_by_sensors,
    "study: by TLS": by_tls.joins_by_tls,
    "study: recorded, played and reported": whole_study.plays_and_reports,
}
_FLAGS = ("--host-resolver-rules=MAP phone.test 127.0.0.1",)
CASES: dict[str, Sequence[Case]] = {
    "phone": (*phone.CASES, *phone_breaks.CASES),
    "questionnaire": questionnaire.CASES,
    "operator": operator.CASES,
    "played": played.CASES,
}


def results(wanted: str = "") -> Iterator[tuple[str, list[str]]]:
    """Each case's name and its faults, the whole study last; `wanted` is part of a name."""
    wanted = wanted.replace("_", " ")
    for page, cases in CASES.items():
        for case in cases:
            name = f"{page}: {case.__name__.replace('_', ' ')}"
            if wanted in name:
                yield name, faults(lambda case=case: _with_stand_in(case))  # type: ignore[misc]
    for name, plays in WHOLE.items():
        if wanted in name:
            yield name, faults(plays)


def _with_stand_in(case: Case) -> None:
    with live_server(lambda *_: None) as server, tab(*_FLAGS) as opened:
        case(opened, server)


def faults(run: Callable[[], None]) -> list[str]:
    """What is wrong, in a line each."""
    try:
        run()
    except (AssertionError, BrowserError) as error:
        lines = [f"{type(error).__name__}: {error}"]
        trace = error.__traceback__
        while trace is not None:
            if "browser/live" in trace.tb_frame.f_code.co_filename:
                lines.append(f"{trace.tb_frame.f_code.co_name}, line {trace.tb_lineno}")
            trace = trace.tb_next
        return lines
    return []


def looks(checker: str | None, wanted: str = "") -> Iterator[tuple[str, list[str]]]:
    """Each state of each page, and what is wrong with how it looks."""
    with live_server(lambda *_: None) as server, tab() as opened:
        fake_sensors(opened)
        for name, scene in SCENES.items():
            if wanted in name:
                yield f"{name}, as it looks", list(dict.fromkeys(looks_faults(scene, opened, server, checker)))

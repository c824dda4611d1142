"""A whole study as it will be: `steadyhand record --demo`, the real pages, a participant with a mouse, the report."""

from __future__ import annotations

import json
import math
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.browser.chromium import Tab, tab
from tests.browser.live.acts import is_seen, key, sized, tab_to, text, touch, value, wait_for, write
from tests.browser.live.marks import key_mark, strip, submit_by_key, submit_by_touch, touch_mark, wait_saved
from tests.browser.live.participant import Participant, Wire
from tests.browser.live.samples import TLX
from tests.browser.live.server import until
from tests.conftest import CLONE

_CONDITIONS = ("quokka", "wombat")
_NAMES = (*_CONDITIONS, "position_kalman", "fusion_kalman", "jackdaw", "magpie")
_STUDY = """
title: Two animals
data_origin: simulated
conditions: [quokka, wombat]
participants: participants.csv
questionnaires: questionnaires.csv
sessions: data/{participant}_{condition}.mcap
axes: [x, y]
streams:
  tracker: {topic: /tracker/position, kind: position, stamp: arrival, latency_s: 0.1, noise_sd_mm: 2, rate_hz: 30}
  imu: {topic: /phone/imu, kind: acceleration, gravity_mm_s2: [0, -9806.65, 0], noise_sd_mm_s2: 100, rate_hz: 90}
  display: {topic: /display/position, kind: display}
events: {topic: /events}
display: {px_per_mm: 10, unit: px}
estimators:
  jackdaw: {type: position_kalman}
  magpie: {type: fusion_kalman}
shown: {quokka: jackdaw, wombat: magpie}
task:
  window_mm: [85.4, 48]
  path_mm: [[-200, 500], [0, 500], [0, 600], [200, 600]]
  targets_mm: [[-150, 500], [-50, 500], [0, 540], [0, 590], [80, 600], [180, 600]]
comparisons:
  - {measure: selection_mse_mm2, test: t_paired}
  - {measure: nasa_tlx/*, test: t_paired}
recording:
  countdown_s: 1
  practice: {targets: 1}
  questionnaires: [nasa_tlx]
  senders: {tracker: {demo: {}}, imu: {demo: {}}}
"""
_ERRORS_MM = ((5.0, 0.0), (-5.0, 2.0), (0.0, 6.0), (3.0, -4.0), (-2.0, -6.0), (6.0, 1.0))
_MARKS = (dict(zip(TLX, (4, 0, 20, 10, 7, 13), strict=True)), dict(zip(TLX, (1, 2, 3, 18, 19, 11), strict=True)))
_POINTS = 5  # of a rating, per mark
_PATIENCE_S = 300.0  # the estimators' first compilation is among it


@contextmanager
def recorder(study: Path, *options: str, **environment: str) -> Iterator[re.Match[str]]:
    """`steadyhand record` of a study; what it said, the operator's address as the first group."""
    with socket.create_server(("127.0.0.1", 0)) as found_free:
        port = str(found_free.getsockname()[1])
    spoken = study / "said.txt"
    command = [sys.executable, "-m", "pipeline", "record", str(study), *options, "--port", port]
    with spoken.open("w") as said:
        all_of_it = {**os.environ, "PYTHONFAULTHANDLER": "1", **environment}
        process = subprocess.Popen(command, cwd=CLONE, env=all_of_it, stdout=said, stderr=subprocess.STDOUT)
        try:

            def address() -> re.Match[str] | None:
                words = spoken.read_text(encoding="utf-8")
                assert process.poll() is None, words
                return re.search(r"(https?://\S+/operator#k=[\w-]+)(?=\s)", words)

            until(lambda: address() is not None, "the operator's address is printed", _PATIENCE_S)
            time.sleep(0.5)  # what follows it is printed too
            found = address()
            assert found is not None
            yield found
        finally:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGABRT)  # says where it stands
                process.wait(20)
                raise AssertionError(f"the recorder does not end: {spoken.read_text(encoding='utf-8')}") from None


class Operator:
    """Does what the big button says, by keys."""

    def __init__(self, page: Tab, address: str) -> None:
        self.page = page
        sized(page, 1440, 900)
        page.open(address)
        until(lambda: value(page, "#links", "it.children.length") > 0, "the state is shown", _PATIENCE_S)

    def links(self) -> dict[str, str]:
        """The phone's and the questionnaire's address, and in a network where a phone learns to trust this computer."""
        found = value(
            self.page, "#links", "[...it.querySelectorAll('a')].map(a => [a.href, a.closest('li').innerText])"
        )
        roles = {"tablet": "questionnaire", "trusts": "ca"}
        return {next((roles[w] for w in roles if w in words), "phone"): address for address, words in found}

    def start(self) -> None:
        """Start the task that is next, with a reason if one is wanted."""
        until(
            lambda: value(self.page, "#big", "it.dataset.do === 'start' && !it.disabled"), "it can start", _PATIENCE_S
        )
        until(lambda: not is_seen(self.page, "#light-list .red"), "no light is red")
        tab_to(self.page, "big")
        key(self.page, "Enter")
        until(lambda: is_seen(self.page, "#reason") or self.runs(), "it starts")
        if is_seen(self.page, "#reason"):
            write(self.page, "A demonstration.")
            key(self.page, "Enter")
        until(self.runs, "it runs")

    def agreement(self, unlike: str) -> str:
        """What is said of the last log's replay, once it is another than before."""
        until(lambda: text(self.page, "#agreement") not in ("", unlike), "the log is replayed", _PATIENCE_S)
        return text(self.page, "#agreement")

    def runs(self) -> bool:
        """Whether a task is under way."""
        return bool(value(self.page, "#big", "it.dataset.do === 'abort'"))


def opened_as(
    operator: Operator, role: str, width: int, height: int, before: Callable[[Tab], None] = lambda _: None
) -> Tab:
    """A participant's page by its link; `before` does something to the tab first."""
    page = operator.page.another()
    sized(page, width, height)
    before(page)
    page.open(operator.links()[role])
    until(lambda: page.evaluate("location.pathname") == f"/{role}", f"the {role}'s page opens")
    return page


def _fill_in(form: Tab, marks: dict[str, int], by_keys: bool) -> None:
    wait_for(form, "#form")
    for count, (item, mark) in enumerate(marks.items()):
        if count == 3:
            wait_saved(form)
            form.reload()
            wait_for(form, "#form")
            assert not value(form, strip("temporal"), "it.matches('.unanswered')")
        (key_mark if by_keys else touch_mark)(form, item, mark)
    (submit_by_key if by_keys else submit_by_touch)(form)


def plays_and_reports() -> None:
    """Two tasks of six targets: errors, times and ratings come out, and no page of a participant learns a name."""
    with tempfile.TemporaryDirectory() as made:
        study, folder = Path(made) / "animals", Path(made) / "recorded"
        study.mkdir()
        (study / "study.yaml").write_text(_STUDY, encoding="utf-8")
        with recorder(study, "--demo", "--out", str(folder)) as words, tab() as opened:
            operator = Operator(opened, words[1])
            phone, form = opened_as(operator, "phone", 1440, 900), opened_as(operator, "questionnaire", 390, 844)
            sized(form, 390, 844)
            touch(phone, "#start")
            player, wire = Participant(phone, _ERRORS_MM), Wire(form)
            said = ""
            for number, marks in enumerate(_MARKS):
                operator.start()
                player.play(reload_before=number and 4)
                _fill_in(form, marks, by_keys=number == 1)
                wire.new()
                said = operator.agreement(unlike=said)
                assert "⁻" in said or "at most 0 mm" in said
            until(lambda: not is_seen(form, "#form"), "the last form is done")
            wire.new()
            _no_name(player.wire, wire, phone, form)
        _comes_out(folder, player)


def _no_name(*parts: Wire | Tab) -> None:
    """No byte that came to a participant's page holds a condition's or an estimator's name."""
    for part in parts:
        came = part.came_text if isinstance(part, Wire) else list(_bodies(part))
        assert len(came) > 3
        for name in _NAMES:
            assert not any(name in one for one in came), name


def _bodies(page: Tab) -> Iterator[str]:
    for event in page.events:
        if event.get("method") == "Network.responseReceived":
            yield json.dumps(event["params"]["response"])
    yield page.evaluate("document.documentElement.outerHTML + document.cookie + location.href")
    yield page.evaluate("JSON.stringify(localStorage) + JSON.stringify(sessionStorage)")
    for script in page.evaluate("performance.getEntriesByType('resource').map(e => e.name)"):
        yield page.evaluate(f"fetch({json.dumps(script)}).then(r => r.text())")


def _comes_out(folder: Path, player: Participant) -> None:
    """What the participant did is what the report says."""
    out = folder / "out"
    command = [
        sys.executable,
        "-m",
        "pipeline",
        "report",
        str(folder),
        "--out",
        str(out),
        "--cache",
        str(folder / "cache"),
    ]
    ran = subprocess.run(command, cwd=CLONE, capture_output=True, text=True, check=False)
    assert ran.returncode in (0, 1), ran.stderr
    results: dict[str, Any] = json.loads(next(out.rglob("results.json")).read_text(encoding="utf-8"))
    assert [row["max_mm"] <= 1e-9 for row in results["replay_agreement"]] == [True, True]
    means = {(row["condition"], row["measure"]): row["mean"] for row in results["descriptives"]}
    order = _order(folder)
    for number, condition in enumerate(order):
        presses = [press for press in player.presses if press.task == f"Task {number + 1}"]
        assert [press.trial for press in presses] == [1, 2, 3, 4, 5, 6]
        squared = [math.dist(press.target_mm, press.seen_mm) ** 2 for press in presses]
        # The wire carries micrometres.
        assert math.isclose(means[condition, "selection_mse_mm2"], sum(squared) / 6, rel_tol=1e-3)
        for item, mark in _MARKS[number].items():
            assert means[condition, f"nasa_tlx/{item}"] == mark * _POINTS


def _order(folder: Path) -> list[str]:
    rows = (folder / "data" / ".recorder" / "answers.jsonl").read_text(encoding="utf-8").splitlines()
    answered = [json.loads(row) for row in rows if "answer" in row]
    return list(dict.fromkeys(row["condition"] for row in answered if row.get("type") == "answer"))

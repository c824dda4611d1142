"""`make bench-live`: latency with 1 and 8 phones while logging, and under a flood; a camera's picture.
`make soak MINUTES=30`: it lasts. `make test-live`: the same latencies, briefly; it fails where they are far too long.

The machine must be quiet for figures that can be compared; what else it did is in them.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from contextlib import suppress
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from mcap.exceptions import EndOfFile
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader

from pipeline.sessions.logs import mcap
from pipeline.sessions.logs.log import Wanted
from tests.benchmarks.live.camera import camera
from tests.benchmarks.live.load import flood, load
from tests.conftest import CLONE

_SECONDS = 20.0
_SETTLED = 0.2  # of the time: what is compiled and learned by then is in memory


def measured(phones: int, seconds: float, with_flood: bool = False) -> dict[str, Any]:
    """The server's figures, and how many readings its logs hold and lack."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        command = [sys.executable, "-m", "tests.benchmarks.live.served", str(folder), str(phones)]
        with subprocess.Popen(command, cwd=CLONE, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as server:
            assert server.stdin is not None and server.stdout is not None
            announced = json.loads(server.stdout.readline())
            context = get_context("spawn")
            loads = [context.Process(target=load, args=(announced, seconds))]
            if with_flood:
                loads.append(context.Process(target=flood, args=(announced[0]["udp"], seconds)))
            for one in loads:
                one.start()
            for one in loads:
                one.join()
            server.stdin.close()
            found: dict[str, Any] = json.loads(server.stdout.read().splitlines()[-1])
        if server.returncode or loads[0].exitcode:
            raise RuntimeError("the server or its load has failed; what it said stands above")
        return {**found, **_logged(folder)}


def _logged(folder: Path) -> dict[str, int]:
    """How many readings the logs hold, how many are missing between the first and the last, and logs set aside.

    A log is set aside where the machine stood still for 2 s, or a phone was away for so long.
    """
    found = {"logs": 0, "set_aside": 0, "logged": 0, "missing": 0}
    for path in folder.glob("*/data/**/*.mcap*"):
        log = mcap.read(path, [Wanted("/tracker/position", "position")])
        tracked = np.round(log.topics["/tracker/position"].values[:, 2] * 1e6).astype(int).tolist()
        for numbers in (tracked, _moved(path)):
            found["logged"] += len(numbers)
            found["missing"] += sum(later - earlier - 1 for earlier, later in pairwise(sorted(numbers)))
        found["set_aside" if path.parent.name == "set-aside" else "logs"] += 1
    return found


def _moved(path: Path) -> list[int]:
    """The numbers of the phone's readings in a log, which may be cut."""
    numbers, of_channel = list[int](), dict[int, str]()
    with path.open("rb") as file, suppress(EndOfFile):
        for record in StreamReader(file).records:
            if isinstance(record, Channel):
                of_channel[record.id] = record.topic
            elif isinstance(record, Message) and of_channel[record.channel_id] == "/phone/raw":
                numbers.append(json.loads(record.data)["seq"])
    return numbers


def _line(name: str, found: dict[str, Any]) -> str:
    figures = " ".join(f"{found[key]:>8.2f}" for key in ("p50", "p99", "p99.9", "max"))
    counts = f"{found['logged']:>10}{found['missing']:>9}{found['core']:>7.0%}{max(found['memory_mb']):>7.0f}"
    return f"  {name:<28}{figures}{counts}"


_HEAD = f"  {'':<28}{'p50':>8} {'p99':>8} {'p99.9':>8} {'max':>8}{'logged':>10}{'missing':>9}{'core':>7}{'MB':>7}"
_RUNS = (("1 phone", 1, False), ("8 phones", 8, False), ("8 phones, 20 000/s flood", 8, True))
_LIMITS_MS = {"p50": 1.0, "p99": 5.0, "p99.9": 20.0}
_FLOODED_MS = {"p99": 10.0}
_SLACK = 4.0  # of a machine that does other things too


def latency(seconds: float = _SECONDS) -> int:
    """A row for each number of phones, and one under a flood: 1 where one takes `_SLACK` times as long as it may."""
    too_long = 0
    print(
        f"Live: from a reading's sending to its estimate's, ms, logs written, {seconds:.0f} s ({os.cpu_count()} cores)"
    )
    print(_HEAD)
    for name, phones, with_flood in _RUNS:
        found = measured(phones, seconds, with_flood)
        print(_line(name, found), flush=True)
        limits = _FLOODED_MS if with_flood else _LIMITS_MS
        too_long += sum(found.get(key, np.inf) > _SLACK * limit for key, limit in limits.items()) + found["missing"]
    camera()
    return int(too_long > 0)


def soak(minutes: float, phones: int) -> int:
    """So many phones for so long: 1 where memory grows or a reading is lost."""
    found = measured(phones, minutes * 60)
    memory = found["memory_mb"][int(len(found["memory_mb"]) * _SETTLED) :]
    half = len(memory) // 2
    grown = float(np.median(memory[half:]) - np.median(memory[:half]))
    print(f"Live, {minutes:g} min: {found['logs']} logs, {found['set_aside']} set aside; load {os.getloadavg()}")
    print(_HEAD)
    print(_line(f"{phones} phones", found))
    print(f"  memory {memory[0]:.0f} MB, at the end {memory[-1]:.0f} MB; from one half to the other {grown:+.1f} MB")
    return int(found["missing"] > 0 or grown > 0.05 * float(np.median(memory)))


if __name__ == "__main__":
    if sys.argv[1:2] == ["soak"]:
        sys.exit(soak(float(sys.argv[2]), int(sys.argv[3])))
    sys.exit(latency(*map(float, sys.argv[1:2])))

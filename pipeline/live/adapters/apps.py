"""A phone's motion by apps that send it in a form of their own, by UDP.

Forms, units and signs are those that the apps' documentation states, and ZIG SIM's published source; none was tried
with the app itself. No orientation is taken from them: which way theirs turns is not stated, so it is found from the
motion (`pipeline.live.orientation`).

- ZIG SIM, in JSON (https://1-10.github.io/zigsim/features/motion.html): `accel` is Core Motion's acceleration without
  gravity and `gravity` its gravity, in g; `gyro` in rad/s. What an iPhone feels at rest points down there, so both are
  turned about. Of other systems it is not known, and they are refused.
- HyperIMU, in CSV (https://ianovir.com/works/mobile/hyperimu/hyperimu-help/): the time in ms since the epoch, then
  three numbers of each sensor, in Android's units. Accelerometer and gyroscope have to be the first two.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from pipeline.errors import PipelineError
from pipeline.live.adapters import keyless
from pipeline.live.adapters.feeds import are_plausible, figures_of, three
from pipeline.live.adapters.keyless import Keyless
from pipeline.live.adapters.newcomers import Newcomers
from pipeline.live.events import Reading
from pipeline.live.messages import DATAGRAM_BYTES, Datagram, MessageError, Three, loaded, number
from pipeline.live.setup import Setup
from pipeline.live.units import units
from pipeline.study.recording import App
from pipeline.study.units import G_M_S2

_HYPERIMU_NUMBERS = 7
_EARLIEST_MS, _LATEST_MS = 1e12, 1e13  # 2001 to 2286: else the first column is no time

Parsed = tuple[Three, Three, float | None]
"""Specific force in m/s², angular velocity in rad/s, and when it was measured, in ms of the phone's clock, if known."""


def zig_sim(data: bytes) -> Parsed:
    """A datagram of ZIG SIM on an iPhone. Raises MessageError for anything else."""
    content = loaded(data, DATAGRAM_BYTES)
    device, sensors = (_object(content, key) for key in ("device", "sensordata"))
    if device.get("os") != "ios":
        raise MessageError("which way accelerations point is known of an iPhone alone")
    moved, gravity, turning = (_xyz(sensors, key) for key in ("accel", "gravity", "gyro"))
    x, y, z = (-(own + of_earth) * G_M_S2 for own, of_earth in zip(moved, gravity, strict=True))
    return (x, y, z), turning, None


def hyperimu(data: bytes) -> Parsed:
    """A datagram of HyperIMU whose first sensors are accelerometer and gyroscope. Raises MessageError for any other."""
    try:
        sent_ms, *figures = (float(cell) for cell in data.decode("ascii").split(",")[:_HYPERIMU_NUMBERS])
    except ValueError:  # UnicodeDecodeError is one
        raise MessageError("it is no row of numbers") from None
    if len(figures) != _HYPERIMU_NUMBERS - 1 or not are_plausible(figures):
        raise MessageError("numbers of accelerometer or gyroscope are missing")
    if not _EARLIEST_MS < sent_ms < _LATEST_MS:
        raise MessageError("the time is missing")
    return three(figures), three(figures[3:]), sent_ms


PARSED: Mapping[str, Callable[[bytes], Parsed]] = {"zig_sim": zig_sim, "hyperimu": hyperimu}
"""What reads an app's datagram, by the app's name."""


def _object(content: object, key: str) -> Mapping[str, Any]:
    found = content.get(key) if isinstance(content, dict) else None
    if not isinstance(found, dict):
        raise MessageError(f"{key} should be an object")
    return found


def _xyz(sensors: Mapping[str, Any], key: str) -> Three:
    found = _object(sensors, key)
    return number(found.get("x"), key), number(found.get("y"), key), number(found.get("z"), key)


def check(stream: str, content: str, settings: App, where: str) -> None:
    """Raise PipelineError for a stream that no phone's motion can feed."""
    if content == "position":
        raise PipelineError(
            f"{where}: recording: senders.{stream}: app: {settings.name} sends a phone's motion and no positions; use"
            " it for a stream of kind acceleration"
        )


def expected(setup: Setup, port: int) -> tuple[str, Keyless]:
    """The app of a port, and the stream that it feeds."""
    name, sender, app = next(
        (name, one, one.app)
        for name, one in setup.recording.senders.items()
        if one.app is not None and one.app.port == port
    )
    return app.name, Keyless(name, setup.streams[name].content, units(sender), app.source)


class Receiver(keyless.Receiver):
    """A port for one app."""

    def __init__(
        self,
        app: str,
        stream: Keyless,
        newcomers: Newcomers,
        happens: Callable[[Reading], None],
        now_ns: Callable[[], int],
    ) -> None:
        super().__init__(newcomers, happens, now_ns)
        self._app, self._stream = app, stream

    def take(self, data: bytes, source: str, now: int) -> None:
        """A datagram within the limits."""
        try:
            force, turning, sent_ms = PARSED[self._app](data)
        except MessageError:
            self.refused["not understood"] += 1
            return
        figures: Datagram = figures_of(self._stream.stream, None, (force, turning))
        self.use(self._stream, figures, self._app, source, now, sent_ms)

"""Readings of a Lab Streaming Layer outlet, by pylsl.

The library blocks, so a thread of its own pulls, and hands what came over to the loop. LSL measures how far the
outlet's clock is from this computer's (`time_correction`, which goes into the log), so a sample's time is known.
(https://labstreaminglayer.readthedocs.io)
"""

from __future__ import annotations

import asyncio
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from pipeline.live.adapters.client import BACK_OFF_S
from pipeline.live.adapters.feeds import READINGS_PER_SECOND, Feed, of_numbers
from pipeline.live.adapters.lsl_outlets import Found, unfit
from pipeline.live.events import ClockOffset, Link, Reading
from pipeline.live.limits import Flow, admit
from pipeline.study.recording import Lsl

LOOK_S, _WAIT_S, _CORRECT_S = 1.0, 0.2, 2.0
_CORRECT_NS = 2_000_000_000
_MOST = 1024  # samples at once
_NS_PER_S, _MS_PER_NS = 1e9, 1e-6

Sample = tuple[Sequence[object], int]
"""Its channels, and when it was measured, in ns of recorder time."""


class Outlet:
    """An outlet that is looked for, and listened to until it is closed. `refused` counts what was not taken."""

    def __init__(self, feed: Feed, settings: Lsl, happens: Callable[[Any], None], now_ns: Callable[[], int]) -> None:
        self._feed, self._settings, self._happens, self._now_ns = feed, settings, happens, now_ns
        self._problem: str | None = None
        self._flow = Flow(READINGS_PER_SECOND, now_ns())
        self.refused: Counter[str] = Counter()
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._pull, name=f"lsl {feed.stream}", daemon=True)

    def listen(self) -> None:
        """Begin, in the loop that runs."""
        self._loop = asyncio.get_running_loop()
        self._thread.start()

    def close(self) -> None:
        """Listen no more."""
        self._closed.set()
        self._thread.join(LOOK_S + _WAIT_S)

    def take(self, samples: Sequence[Sample]) -> None:
        """What was pulled at once; how it is cut makes no difference."""
        now = self._now_ns()
        for values, stamp_ns in samples:
            self._flow, admitted = admit(self._flow, READINGS_PER_SECOND, now)
            numbers = [values[channel] for channel in self._settings.channels if channel < len(values)]
            reading = self._feed.reading(of_numbers(self._feed.stream, self._feed.content, numbers), now)
            if not admitted or reading is None:
                reason = "too many samples" if not admitted else "not of the stream's kind"
                self.refused[f"{self._feed.stream}: {reason}"] += 1
                continue
            self._happens(Reading(reading.stream, stamp_ns, now, reading.values))

    def _say(self, problem: str) -> None:
        if problem != self._problem:
            self._problem = problem
            said = f"{self._feed.stream}: {problem}" if problem else ""
            self._happens(Link(self._feed.stream, said, self._now_ns()))

    # --- in the thread

    def _post(self, what: Callable[..., None], *arguments: Any) -> None:
        with suppress(RuntimeError):  # the loop is closed: the study is over
            self._loop.call_soon_threadsafe(what, *arguments)

    def _pull(self) -> None:
        import pylsl

        failures = 0
        while not self._closed.is_set():
            streams = self._found(pylsl)
            if self._closed.is_set():
                return
            problem = unfit(self._settings, [Found.of(one) for one in streams])
            if not problem:
                failures = 0
                problem = self._listen(pylsl, next(one for one in streams if one.name() == self._settings.name))
            if not self._closed.is_set():
                self._post(self._say, problem)
            self._closed.wait(BACK_OFF_S[min(failures, len(BACK_OFF_S) - 1)])
            failures += 1

    def _found(self, pylsl: Any) -> list[Any]:
        """What is there within a second; at the end of the study that second is not waited out."""
        looking = pylsl.ContinuousResolver()
        self._closed.wait(LOOK_S)
        streams: list[Any] = looking.results()
        return streams

    def _listen(self, pylsl: Any, info: Any) -> str:
        """Until it is closed or lost; what is wrong then."""
        inlet = pylsl.StreamInlet(info, max_buflen=2, recover=False)
        corrected_ns, offset_ns = -_CORRECT_NS, 0
        try:
            inlet.open_stream(timeout=_CORRECT_S)
            while not self._closed.is_set():
                if self._now_ns() - corrected_ns >= _CORRECT_NS:
                    corrected_ns = self._now_ns()
                    # LSL's clock here and recorder time count the same seconds, each from an origin of its own.
                    off_s = inlet.time_correction(timeout=_CORRECT_S)  # the first takes a while
                    offset_ns = self._now_ns() - round((pylsl.local_clock() - off_s) * _NS_PER_S)
                    measured = ClockOffset(self._feed.stream, offset_ns * _MS_PER_NS, corrected_ns)
                    self._post(self._happens, measured)
                first, time_s = inlet.pull_sample(timeout=_WAIT_S)
                if first is None:
                    continue
                rest, times_s = inlet.pull_chunk(timeout=0.0, max_samples=_MOST)
                every = zip([first, *rest], [time_s, *times_s], strict=True)
                self._post(self._say, "")
                self._post(self.take, [(values, round(at * _NS_PER_S) + offset_ns) for values, at in every])
        except (RuntimeError, ValueError, OSError) as error:  # what pylsl raises, a lost stream among it
            return f'the LSL stream "{self._settings.name}" is gone ({error}); start it again. Looking for it.'
        finally:
            inlet.close_stream()
        return ""

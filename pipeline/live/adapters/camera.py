"""Readings of a webcam that sees printed markers, by OpenCV.

The library blocks, so a thread of its own takes pictures and looks for markers, and hands what it saw over to the loop.
No picture outlives the next one. A reading's stamp is when its picture was there, less what `late_ms` says of the way.
"""

from __future__ import annotations

import asyncio
import threading
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.errors import PipelineError
from pipeline.live import marker
from pipeline.live.adapters.camera_device import Capture, Device
from pipeline.live.adapters.feeds import Feed, figures_of, three
from pipeline.live.events import Link, Reading

AGAIN_S = 1.0
_CLOSES_S = 2.0
UNSEEN_NS = 300_000_000
TWICE, UNSEEN, BENT = "marker seen twice", "marker not seen", "marker not flat"


@dataclass(frozen=True)
class Wanted:
    """A stream, and the marker that it is of."""

    feed: Feed
    number: int
    size_mm: float


class Webcam:
    """A camera that is listened to until it is closed. `refused` counts pictures without a reading."""

    def __init__(
        self, device: Device, wanted: Sequence[Wanted], happens: Callable[[Any], None], now_ns: Callable[[], int]
    ) -> None:
        self._device, self._wanted, self._happens, self._now_ns = device, wanted, happens, now_ns
        self._problems: dict[str, str] = {}
        self._seen_ns = dict.fromkeys((one.feed.stream for one in wanted), now_ns())
        self.refused: Counter[str] = Counter()
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._watch, name=f"camera {device.number}", daemon=True)

    async def begin(self) -> None:
        """Open it, and watch. Raises PipelineError where it cannot be opened."""
        self._loop = asyncio.get_running_loop()
        self._capture: Capture | None = await asyncio.to_thread(self._device.open)
        self._thread.start()

    def close(self) -> None:
        """Watch no more."""
        self._closed.set()
        self._thread.join(_CLOSES_S)

    # --- in the loop

    def take(self, found: Mapping[str, tuple[float, ...] | str], at_ns: int) -> None:
        """What a picture showed, by stream: a place in mm, or why there is none."""
        now = self._now_ns()
        for one in self._wanted:
            stream, place = one.feed.stream, found[one.feed.stream]
            figures = None if isinstance(place, str) else figures_of(stream, three(place), None)
            reading = one.feed.reading(figures, now)
            if reading is not None:
                self._seen_ns[stream] = now
                self._say(stream, "")
                self._happens(Reading(stream, min(at_ns - self._device.late_ns, now), now, reading.values))
                continue
            self.refused[f"{stream}: {place}"] += 1
            if place == TWICE:
                self._say(stream, f"sees marker {one.number} twice; cover one, or print another --id.")
            elif now - self._seen_ns[stream] > UNSEEN_NS:
                self._say(stream, f"does not see marker {one.number}; hold it flat, in view, in the light.")

    def _say(self, stream: str, problem: str) -> None:
        if problem != self._problems.get(stream):
            self._problems[stream] = problem
            said = f"{stream}: camera {self._device.number} {problem}" if problem else ""
            self._happens(Link(stream, said, self._now_ns()))

    def _fail(self, problem: str) -> None:
        for one in self._wanted:
            self._say(one.feed.stream, f"{problem}. Trying again.")

    # --- in the thread

    def _post(self, what: Callable[..., None], *arguments: Any) -> None:
        with suppress(RuntimeError):  # the loop is closed: the study is over
            self._loop.call_soon_threadsafe(what, *arguments)

    def _watch(self) -> None:
        finds = marker.finder()
        while not self._closed.is_set():
            problem = self._picture(finds)
            if problem:
                if self._capture is not None:
                    self._capture.release()
                    self._capture = None
                self._post(self._fail, problem)
                self._closed.wait(AGAIN_S)
        if self._capture is not None:
            self._capture.release()

    def _picture(self, finds: Any) -> str:
        """Look at the next picture; what is wrong with the camera."""
        import cv2

        try:
            if self._capture is None:
                self._capture = self._device.open()
            if not self._capture.grab():
                return "gives no pictures any more; see whether it is plugged in"
            at_ns = self._now_ns()
            given, picture = self._capture.retrieve()
            if not given or self._device.wrong_size(picture):
                return self._device.wrong_size(picture) if given else "gives damaged pictures; plug it in anew"
            grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) if picture.ndim == 3 else picture
            self._post(self.take, self._found(finds, grey), at_ns)
        except PipelineError as error:
            return str(error).removeprefix(f"camera {self._device.number} ")
        except cv2.error as error:
            return f"gives pictures that cannot be read ({' '.join(str(error).split())}); plug it in anew"
        return ""

    def _found(self, finds: Any, grey: np.ndarray) -> dict[str, tuple[float, ...] | str]:
        seen = marker.markers(finds, grey)
        found: dict[str, tuple[float, ...] | str] = {}
        for one in self._wanted:
            corners = seen.get(one.number, ())
            if len(corners) != 1:
                found[one.feed.stream] = TWICE if corners else UNSEEN
            else:
                place = marker.position_mm(grey, corners[0], one.size_mm, self._device.lens)
                found[one.feed.stream] = BENT if place is None else place
        return found

"""A camera as OpenCV opens it: that it is there, gives pictures, and of the size that study.yaml says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from pipeline.errors import PipelineError
from pipeline.live.lens import Lens


class Capture(Protocol):
    """A camera, as `cv2.VideoCapture` is one."""

    def grab(self) -> bool:
        """Wait for the next picture; whether there is one."""

    def retrieve(self) -> tuple[bool, np.ndarray]:
        """The picture, if it is whole."""

    def release(self) -> None:
        """Let go of it."""


@dataclass(frozen=True)
class Device:
    """A camera as study.yaml has it. `late_ns` is how long before it is handed over a picture was taken."""

    number: int
    size: tuple[int, int]
    lens: Lens
    late_ns: int

    def open(self) -> Capture:
        """Raises PipelineError where it cannot be opened, or gives pictures of another size."""
        import cv2

        cv2.setNumThreads(1)  # the loop has the other cores
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # what it would say is said below
        capture = cv2.VideoCapture(self.number)
        capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))  # by USB 2, others are slow when large
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, self.size[0])
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self.size[1])
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)  # no old pictures
        problem = self._unfit(capture)
        if problem:
            capture.release()
            raise PipelineError(f"camera {self.number} {problem}")
        return capture

    def _unfit(self, capture: Any) -> str:
        if not capture.isOpened():
            return "is not there, or another program uses it; plug it in, end that program, or choose another `device`"
        given, picture = capture.retrieve() if capture.grab() else (False, np.zeros((0, 0)))
        if not given:
            return "gives no picture; end other programs that use it, and plug it in anew"
        return self.wrong_size(picture)

    def wrong_size(self, picture: np.ndarray) -> str:
        """What is said of a picture of another size than wanted; nothing of one that has it."""
        height, width = picture.shape[:2]
        if (width, height) == self.size:
            return ""
        return f"gives {width} × {height} and not {self.size[0]} × {self.size[1]}; write size: [{width}, {height}]"

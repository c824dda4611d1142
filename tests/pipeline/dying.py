"""Stages that kill the process they run in, as the kernel does where memory is short."""

from __future__ import annotations

import os
import signal
from pathlib import Path

from pipeline.stage import Outcome, Work
from pipeline.stages import fuse

POISONED = "P1_a"


def whenever(work: Work) -> Outcome:
    """Fusion, of which the process dies whenever it meets one session."""
    if work.session.id == POISONED:
        os.kill(os.getpid(), signal.SIGKILL)
    return fuse.run(work)


def once(work: Work) -> Outcome:
    """Fusion, of which the process dies the first time it meets one session."""
    if work.session.id == POISONED:
        try:
            Path(work.folder / "died").touch(exist_ok=False)
        except FileExistsError:
            return fuse.run(work)
        os.kill(os.getpid(), signal.SIGKILL)
    return fuse.run(work)

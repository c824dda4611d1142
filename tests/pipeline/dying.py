"""Stages that kill the process they run in, as the kernel does where memory is short, or say which one it is."""

from __future__ import annotations

import os
import signal
from pathlib import Path

from pipeline.engine.stage import Outcome, Work
from pipeline.sessions import fuse, replay

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


def of_one_variant(work: Work) -> Outcome:
    """A replay, of which the process dies whenever it meets one session with one estimator."""
    if work.session.id == POISONED and "held" in work.study.estimators:
        os.kill(os.getpid(), signal.SIGKILL)
    return replay.run(work)


def of_a_study(work: Work) -> Outcome:
    """A stage of a whole study, of which the process always dies."""
    os.kill(os.getpid(), signal.SIGKILL)
    return Outcome()


def note_helper(work: Work) -> Outcome:
    """A stage of a whole study that notes which process computes it, and which one does its jobs."""
    assert work.executor is not None
    (work.out / "processes").write_text(f"{os.getpid()} {work.executor.submit(os.getpid).result()}")
    return Outcome()

"""Processes forked from one that has imported what they need, so that starting one costs a test next to nothing."""

from __future__ import annotations

import multiprocessing

FORKED = multiprocessing.get_context("forkserver")
FORKED.set_forkserver_preload(
    [
        "pipeline.commands.run",
        "pipeline.sessions.ingest",
        "pipeline.sessions.fuse",
        "pipeline.sessions.assess",
        "pipeline.analysis.measure",
        "pipeline.analysis.compare",
        "pipeline.report.write",
        "distributed.dashboard.worker",  # where Dask is installed
        "tests.pipeline.warmed",
        "tests.pipeline.dying",
        "tests.pipeline.engine.test_cache",
    ]
)


def keep_these() -> None:
    """A command that a test runs names fewer modules. Whichever list came first would hold for all tests."""
    FORKED.set_forkserver_preload = lambda _modules: None  # type: ignore[assignment, method-assign]

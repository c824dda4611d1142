"""The executor that the user chose by name: `--executor` and `--jobs`."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager

from pipeline.engine.processes import InThisProcess, Processes, starting_with
from pipeline.errors import PipelineError, did_you_mean

PROCESS, INLINE, DASK = "process", "inline", "dask"
_SCHEDULERS = (f"{DASK}://", "tls://")  # one as it comes, and one with certificates


def _print(text: str) -> None:
    print(text, file=sys.stderr, flush=True)  # noqa: T201 - beside the output, which may go into a file


@contextmanager
def executor_of(
    jobs: int | None, name: str = PROCESS, say: Callable[[str], None] = _print, modules: Sequence[str] = ()
) -> Iterator[Executor]:
    """The executor of that name, with `jobs` processes (None: as many as there are processors).

    No process starts before there is work for it; with one job, everything is computed in this process. Processes of
    this machine have `modules` imported when they start. `say` is called with the address of a Dask cluster's
    dashboard. Raises PipelineError where no executor has that name, or where Dask is not installed or does not answer.
    """
    count = jobs or os.cpu_count() or 1
    if name == INLINE or (name == PROCESS and count == 1):
        yield InThisProcess()
    elif name == PROCESS:
        with Processes(count, starting_with(modules)) as processes:
            yield processes
    elif name == DASK or (name.startswith(_SCHEDULERS) and name not in _SCHEDULERS):
        _require_dask(name)
        from pipeline.engine.dask_cluster import on_dask

        address = None if name == DASK else name.replace(f"{DASK}://", "tcp://")
        with on_dask(address, count, say) as cluster:
            yield cluster
    else:
        known = (PROCESS, INLINE, DASK, *(f"{scheduler}host:port" for scheduler in _SCHEDULERS))
        raise PipelineError(f'--executor: there is no "{name}"{did_you_mean(name, known)}')


def _require_dask(name: str) -> None:
    try:
        import distributed  # noqa: F401 - is it installed?
    except ImportError:
        raise PipelineError(
            f'--executor {name}: Dask is not installed here; install it with: pip install "steadyhand[dask]"'
        ) from None

"""Computing on the workers of a Dask cluster. This imports Dask, so it is imported only for `--executor dask`."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, Executor, Future
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import dask
from distributed import Client, LocalCluster, WorkerPlugin
from distributed.scheduler import KilledWorker
from distributed.security import Security

from pipeline.engine import threads
from pipeline.engine.code_digest import code_digest
from pipeline.engine.stage import Work
from pipeline.errors import RUN_AGAIN, PipelineError, WorkerLostError

_STAGES = "pipeline.stages"  # the digest of this module's code follows the code of every stage
_IGNORE_CTRL_C = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"  # only the command handles it
_REPLACED_WITHIN_S = 10


class OneThread(WorkerPlugin):
    """Tells a worker, before it imports NumPy for us, to keep numeric libraries from starting threads."""

    name = "steadyhand-one-thread"

    def setup(self, worker: Any) -> None:
        """Called when a worker starts, also when Dask restarts it."""
        threads.limit_to_one_thread()


class OnDask(Executor):
    """An executor over the workers of a cluster. If a worker dies, Dask itself gives its work to another."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._code = code_digest(_STAGES)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Compute on some worker, provided that its code is the same as here and that it can see the folders."""
        folders = sorted(set(_folders(args)))
        on_dask = self._client.submit(checked_call, self._code, folders, fn, args, kwargs, pure=False)
        future = _DaskFuture(on_dask)
        on_dask.add_done_callback(future.take)
        return future


def _folders(args: Iterable[Any]) -> Iterator[Path]:
    """The folders among a call's arguments, at any depth of nesting: a worker must be able to see them."""
    for arg in args:
        if isinstance(arg, list | tuple):
            yield from _folders(arg)
        elif isinstance(arg, Work | Path):
            yield arg.folder if isinstance(arg, Work) else arg


class _DaskFuture(Future[Any]):
    """A future of the standard library that stands for one of Dask's."""

    def __init__(self, on_dask: Any) -> None:
        super().__init__()
        self._on_dask = on_dask

    def cancel(self) -> bool:
        """Cancel it here and on the cluster."""
        cancelled = super().cancel()
        if cancelled:
            self._on_dask.cancel()
        return cancelled

    def take(self, on_dask: Any) -> None:
        """Take over the result or the error, once Dask has it."""
        if not self.set_running_or_notify_cancel():
            return
        try:
            self.set_result(on_dask.result())
        except KilledWorker:
            self.set_exception(WorkerLostError("several workers died"))
        except (CancelledError, ConnectionError, TimeoutError):
            self.set_exception(PipelineError(f"--executor dask: lost the Dask scheduler. {RUN_AGAIN}"))
        except ImportError as error:
            self.set_exception(_different_code(f"one cannot import {error.name}"))
        except Exception as error:  # noqa: BLE001 - handed on by the future
            self.set_exception(error)


def checked_call(
    code: str, folders: list[Path], fn: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]
) -> Any:
    """Call the function on a worker, after checking that it would give the same result here.

    Raises PipelineError where the worker's code has another digest than `code`, or where it cannot see a folder.
    """
    if code_digest(_STAGES) != code:
        raise _different_code("their code, Python or libraries differ")
    for folder in folders:
        if not folder.is_dir():
            raise PipelineError(
                f"--executor dask: a worker cannot see {folder}; put the studies and --cache on a file system that all"
                " workers share, under the same path"
            )
    return fn(*args, **kwargs)


def _different_code(difference: str) -> PipelineError:
    return PipelineError(
        f"--executor dask: the workers do not run the same Steadyhand as this command: {difference}; install the same"
        " version with the same libraries on them, and restart them"
    )


def _await_replacements(client: Client, count: int) -> None:
    """Wait for a worker that replaces one that died: Dask cannot close a cluster that is just starting one."""
    with suppress(OSError, TimeoutError):
        client.wait_for_workers(count, timeout=_REPLACED_WITHIN_S)


@contextmanager
def on_dask(address: str | None, count: int, say: Callable[[str], None], connect_s: float = 10.0) -> Iterator[Executor]:
    """The executor for the scheduler at an address; without one, for a cluster of `count` processes of this machine.

    An address is `tcp://host:port`, or `tls://host:port` for one with certificates, which Dask's own configuration
    names. The cluster of this machine has certificates for as long as it runs, which never leave its processes.

    Raises PipelineError where no scheduler answers within `connect_s` seconds.
    """
    for name in filter(re.compile(r"distributed\b").match, [*logging.root.manager.loggerDict]):
        logging.getLogger(name).setLevel(
            logging.CRITICAL
        )  # errors are raised as well, so logging them would say them twice
    with ExitStack() as open_until_done:
        if address is None:
            # A session that kills its worker is tried again by itself later; the others must not wait for retries.
            open_until_done.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": 1}))
            cluster = LocalCluster(
                n_workers=count,
                threads_per_worker=1,
                protocol="tls://",
                security=Security.temporary(),  # else any user of this machine could run code in the workers
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
                preload=_IGNORE_CTRL_C,
            )
            open_until_done.enter_context(cluster)
            client = Client(cluster)
        else:
            try:
                client = Client(address, timeout=connect_s)
            except (OSError, ValueError, TypeError) as error:  # TypeError: TLS without certificates
                name, with_certificates = address.replace("tcp://", "dask://"), ""
                if address.startswith("tls://"):
                    with_certificates = ", with the certificates of distributed.comm.tls in Dask's configuration"
                raise PipelineError(
                    f"--executor {name}: no Dask scheduler answers there ({error}); start one with: dask"
                    f" scheduler{with_certificates}"
                ) from None
        open_until_done.enter_context(client)
        if address is None:
            open_until_done.callback(_await_replacements, client, count)
        client.register_plugin(OneThread())
        say(f"Dask dashboard: {client.dashboard_link}")
        yield OnDask(client)

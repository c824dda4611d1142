"""How many threads numeric libraries may start."""

import os

_LIBRARIES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def limit_to_one_thread() -> None:
    """Keep numeric libraries from starting threads, in this process and in those that it starts.

    The matrices are small, and sessions are computed in parallel by processes, so threads would only compete. Must be
    called before NumPy is imported.
    """
    for name in _LIBRARIES:
        os.environ.setdefault(name, "1")

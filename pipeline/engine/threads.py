"""How many threads a process of ours may start."""

import os

_LIBRARIES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def one_a_process() -> None:
    """Keep numeric libraries from starting threads, here and in processes started from here.

    Many small matrices, and processes for the rest. To be called before NumPy is imported.
    """
    for name in _LIBRARIES:
        os.environ.setdefault(name, "1")

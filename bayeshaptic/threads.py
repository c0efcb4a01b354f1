"""Settings of the whole process while we compute: one BLAS thread, and no errors of underflow.

More threads make our many small matrix products slower, and change the order of summation, so that
results would depend on the number of cores.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from functools import lru_cache, wraps
from typing import TYPE_CHECKING, ParamSpec, TypeVar

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

P = ParamSpec("P")
R = TypeVar("R")

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_here = threading.local()


def single_threaded(function: Callable[P, R]) -> Callable[P, R]:
    """Decorator: `function` runs with one BLAS thread; the setting is put back afterwards.

    Densities underflow to nothing in it, whatever a caller has `numpy.seterr` do then.  Inside
    another such function it costs nothing.
    """

    @wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> R:
        if getattr(_here, "limited", False):
            return function(*args, **kwargs)
        import numpy as np

        _here.limited = True
        try:
            limit = _libraries(len(sys.modules)).limit(limits=1, user_api="blas")
            with limit, np.errstate(under="ignore"):
                return function(*args, **kwargs)
        finally:
            _here.limited = False

    return limited


@lru_cache(maxsize=1)
def _libraries(modules: int) -> ThreadpoolController:
    """The BLAS libraries; they are looked for again (2 ms) where modules have been loaded since."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def one_thread_from_the_start() -> None:
    """Ask for one BLAS thread by the environment, for this process and those it starts.

    It works only before NumPy is loaded, and leaves alone what the user has set.
    """
    for name in THREADS:
        os.environ.setdefault(name, "1")

"""A time, a force and a position, and a CSV file of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

N = 50
TIME = np.arange(N) * 1e-3
FORCE = np.random.default_rng(0).normal(size=N)
POSITION = 1e-3 * np.random.default_rng(1).normal(size=N)
SIGNALS = {"t": TIME, "u": FORCE, "q": POSITION}
MAPPING = "time=t,force=u,position=q"


def write_csv(path: Path, header: str = "t,u,q") -> None:
    np.savetxt(
        path, np.column_stack(list(SIGNALS.values())), header=header, comments="", delimiter=","
    )

"""What all tests share: one BLAS thread, figures without windows, and the measured recordings."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from bayeshaptic.threads import one_thread_from_the_start

one_thread_from_the_start()
os.environ.setdefault("MPLBACKEND", "Agg")
# Processes of tests are started as users start them: unbuffered, they hide what a pipe cannot do.
os.environ.pop("PYTHONUNBUFFERED", None)

MEASURED = Path(
    os.environ.get("BAYESHAPTIC_MEASURED", Path(__file__).parents[2] / "shared" / "measured")
)


@pytest.fixture
def measured() -> Callable[[str], Path]:
    """The path of a measured recording, which the project does not contain; skips without it."""

    def find(name: str) -> Path:
        path = MEASURED / name
        if not path.exists():
            pytest.skip(f"measured recording not found: {path} (set BAYESHAPTIC_MEASURED)")
        return path

    return find

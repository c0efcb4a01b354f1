"""How often Python looks for garbage, in processes that are ours alone."""

from __future__ import annotations

import gc


def look_rarely() -> None:
    """Look for objects that refer to each other in circles once in 50,000, and not in 700.

    A figure is thousands of them: the looking takes a fourteenth of a report.
    """
    gc.set_threshold(50_000, 20, 20)

"""Files that may be gzipped: what is in them, whatever they are packed in."""

from __future__ import annotations

import gzip
import os
import zlib
from pathlib import Path
from typing import BinaryIO, cast

_BLOCK = 1 << 20  # bytes that are compared at once


def opened(path: Path) -> BinaryIO:
    """A file to read from, unpacked where it is gzipped."""
    return cast(BinaryIO, gzip.open(path, "rb")) if _is_packed(path) else path.open("rb")


def same_content(one: Path, other: Path) -> bool:
    """Whether two files hold the same; not said of what is empty or cannot be read."""
    try:
        if not 0 < _size(one) == _size(other):
            return False
        with opened(one) as first, opened(other) as second:
            while block := first.read(_BLOCK):
                if block != second.read(_BLOCK):
                    return False
            return not second.read(1)
    except (OSError, EOFError, zlib.error):
        return False


def _is_packed(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(2) == b"\x1f\x8b"


def _size(path: Path) -> int:
    """Bytes of the content; of a gzipped file as it says at its end, modulo 4 GiB."""
    if not _is_packed(path):
        return path.stat().st_size % 2**32
    with path.open("rb") as file:
        file.seek(-4, os.SEEK_END)
        return int.from_bytes(file.read(4), "little")

"""The sizes that a MAT file of version 5 or 4 claims, looked at before memory is taken for them.

SciPy takes memory for what an array, a text or a cell says of itself, at any depth. Here only the
headers are read; of packed variables no more is unpacked than it takes to get from one to the next.
The format is MathWorks' "MAT-File Format", R2019b, chapter 1.
"""

from __future__ import annotations

import io
import math
import struct
import zlib
from pathlib import Path
from typing import Any, Literal

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.readers.reader import MOST_NUMBERS, refuse_size
from bayeshaptic.recordings.readers.tree import DEEPEST

MOST_BYTES = 8 * MOST_NUMBERS  # of one variable, unpacked
MOST_ARRAYS = 1_000_000

_MATRIX, _PACKED = 14, 15
_CELL, _STRUCTURE, _OBJECT, _OPAQUE = 1, 2, 3, 17
_CHUNK = 1 << 16
_V4_BYTES = (8, 4, 4, 2, 2, 1)  # of a number, by the second digit of its type from the right


class _End(Exception):
    """The file ends, or goes on in a way that is not known here: for its reader to judge."""


def refuse_sizes(path: Path) -> None:
    """Refuse a file with an array that claims more than can be read, or than the file holds.

    Raises
    ------
    InputError
        The message names the file and what it claims.
    """
    with path.open("rb") as file:
        start = file.read(128)
        size = path.stat().st_size
        try:
            if len(start) == 128 and start[126:128] in (b"IM", b"MI"):
                order = "<" if start[126:128] == b"IM" else ">"
                _Walk(path, order).variables(file, size)
            elif len(start) >= 20 and 0 in start[:4]:
                file.seek(0)
                _version_4(path, file, size)
        except _End:
            return


class _Walk:
    """From header to header of a version 5 file."""

    def __init__(self, path: Path, order: str) -> None:
        self.path, self.order = path, order
        self.bytes: Literal["little", "big"] = "little" if order == "<" else "big"
        self.arrays_left = MOST_ARRAYS

    def variables(self, file: Any, size: int) -> None:
        """All variables of the file."""
        while (place := file.tell()) < size:
            kind, count = self.tag(file)
            if kind == _PACKED:
                inner = _Unpacked(file, min(count, size - place - 8), self.path)
                inside, claimed = self.tag(inner)
                if inside == _MATRIX:
                    self.refuse(claimed, MOST_BYTES)
                    self.array(inner, claimed, DEEPEST)
            elif kind == _MATRIX:
                self.refuse(count, size - place - 8)
                self.array(file, count, DEEPEST)
            file.seek(place + 8 + count)

    def refuse(self, claimed: int, most: int) -> None:
        """Refuse what claims more bytes than there can be."""
        if claimed > most:
            raise InputError(
                f"{self.path}: a variable claims {claimed} bytes where at most {most} can be: "
                "damaged, or larger than can be read"
            )

    def tag(self, file: Any) -> tuple[int, int]:
        """Type and bytes of the next element, of those that are never short."""
        return struct.unpack(f"{self.order}II", _exactly(file, 8))

    def data(self, file: Any, most: int) -> tuple[bytes, int]:
        """The next element's data, and the bytes that it takes in the file."""
        words = _exactly(file, 8)
        first, count = struct.unpack(f"{self.order}II", words)
        if first >> 16:
            return words[4 : 4 + min(first >> 16, 4)], 8
        self.refuse(count, most)
        padded = -(-count // 8) * 8
        return _exactly(file, padded)[:count], 8 + padded

    def array(self, file: Any, size: int, depth: int) -> None:
        """One array of `size` bytes, and the arrays in it."""
        self.arrays_left -= 1
        if self.arrays_left < 0:
            raise InputError(f"{self.path}: more than {MOST_ARRAYS} arrays; save plain vectors")
        if size == 0 or depth == 0:
            return _skip(file, size)
        flags, used = self.data(file, size)
        kind = int.from_bytes(flags[:4], self.bytes) & 0xFF
        if kind == _OPAQUE:  # what follows are names
            return _skip(file, size - used)
        sizes, taken = self.data(file, size)
        used += taken
        shape = struct.unpack(f"{self.order}{len(sizes) // 4}i", sizes[: len(sizes) // 4 * 4])
        if min(shape, default=0) < 0:
            raise InputError(f"{self.path}: an array claims the shape {shape}")
        refuse_size(shape, f"{self.path}")
        used += self.data(file, size)[1]  # its name
        if kind not in (_CELL, _STRUCTURE, _OBJECT):
            return self.elements(file, size - used)
        inside = math.prod(shape)
        if kind == _OBJECT:
            used += self.data(file, size)[1]
        if kind != _CELL:
            longest, taken = self.data(file, size)
            names, more = self.data(file, size)
            used += taken + more
            inside *= len(names) // max(int.from_bytes(longest, self.bytes), 1)
        self.refuse(8 * inside, size - used)  # each has at least a tag
        for _ in range(inside):
            member, count = self.tag(file)
            if member != _MATRIX:
                raise _End
            self.refuse(count, size - used - 8)
            self.array(file, count, depth - 1)
            used += 8 + count
        _skip(file, size - used)

    def elements(self, file: Any, left: int) -> None:
        """Numbers or text: what is left of an array, up to three elements."""
        while left >= 8:
            first, count = self.tag(file)
            left -= 8
            if not first >> 16:
                self.refuse(count, left)
                padded = min(-(-count // 8) * 8, left)
                _skip(file, padded)
                left -= padded
        _skip(file, left)


class _Unpacked(io.RawIOBase):
    """A packed element, unpacked as far as it is read."""

    def __init__(self, file: Any, packed: int, path: Path) -> None:
        self.file, self.packed, self.path = file, packed, path
        self.unpacker = zlib.decompressobj()
        self.ready = b""

    def read(self, size: int = -1) -> bytes:
        """The next `size` bytes, fewer at the end."""
        while len(self.ready) < size:
            waiting = self.unpacker.unconsumed_tail
            if not waiting:
                waiting = self.file.read(min(_CHUNK, self.packed))
                self.packed -= len(waiting)
                if not waiting:
                    break
            try:
                self.ready += self.unpacker.decompress(waiting, _CHUNK)
            except zlib.error:
                raise _End from None
        found, self.ready = self.ready[:size], self.ready[size:]
        return found


def _version_4(path: Path, file: Any, size: int) -> None:
    """A header of five numbers and a name before each matrix."""
    while (place := file.tell()) < size:
        header = _exactly(file, 20)
        order = "<" if struct.unpack("<I", header[:4])[0] < 5000 else ">"
        kind, rows, columns, imaginary, named = struct.unpack(f"{order}5i", header)
        digit = kind // 10 % 10
        if min(kind, rows, columns, named) < 0 or digit >= len(_V4_BYTES):
            raise _End
        refuse_size((rows, columns), f"{path}")
        count = named + rows * columns * _V4_BYTES[digit] * (2 if imaginary == 1 else 1)
        if count > size - place - 20:
            raise InputError(
                f"{path}: a variable claims {count} bytes where {size - place - 20} are left: "
                "the file is cut off, or damaged"
            )
        file.seek(place + 20 + count)


def _exactly(file: Any, size: int) -> bytes:
    content = file.read(size)
    if len(content) < size:
        raise _End
    return content


def _skip(file: Any, size: int) -> None:
    """Pass over so many bytes."""
    while size > 0:
        size -= len(_exactly(file, min(size, _CHUNK)))

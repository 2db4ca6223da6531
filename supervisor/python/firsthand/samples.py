"""Samples with slices: grids, fields, ranges, scans."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from functools import cache
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

Header = TypeVar("Header")


@cache
def dtype_of(kind: Any) -> np.dtype[Any]:
    """Return the NumPy type of a ctypes type. Arrays of characters become texts."""
    if issubclass(kind, ctypes.Array):
        length: int = kind._length_
        if kind._type_ is ctypes.c_char:
            return np.dtype(f"S{length}")
        return np.dtype((dtype_of(kind._type_), (length,)))
    if not issubclass(kind, ctypes.Structure):
        number: np.dtype[Any] = np.dtype(kind)
        return number
    names = [field[0] for field in kind._fields_]
    formats, offsets = [dtype_of(field[1]) for field in kind._fields_], [getattr(kind, name).offset for name in names]
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": ctypes.sizeof(kind)})


class Sliced(Generic[Header]):
    """Header and array, which also unpack: `header, elements = sample`.

    The array of `grid` and `field` is (rows, columns) of the window `sample.window` of the map, whose row 0 is the least y and column
    0 the least x. A live sample's array is a view of memory shared with the robot, and read-only. One may be kept while the next
    comes; to keep more, `copy`.
    """

    def __init__(self, header: Header, elements: NDArray[Any]) -> None:
        self.header = header
        part = getattr(header, "part", None)
        # Any process may have written the numbers of a sample.
        if part is not None and int(part.height) * int(part.width) == elements.size:
            elements = elements.reshape(int(part.height), int(part.width))
        self.elements = elements

    def __iter__(self) -> Iterator[Any]:
        return iter((self.header, self.elements))

    def __repr__(self) -> str:
        return f"Sliced({self.header!r}, {self.elements.dtype} {self.elements.shape})"

    @property
    def stamp(self) -> Any:
        return self.header.stamp  # type: ignore[attr-defined]

    @property
    def window(self) -> tuple[slice, slice]:
        """Place of a part in the whole map: `whole[sample.window] = sample.elements`."""
        part = self.header.part  # type: ignore[attr-defined]
        return np.s_[int(part.row) : int(part.row) + int(part.height), int(part.col) : int(part.col) + int(part.width)]

    def copy(self) -> Sliced[Header]:
        return Sliced(self.header, self.elements.copy())


class Map:
    """Whole map, built from live or recorded parts: keyframes and changed windows."""

    def __init__(self) -> None:
        self.cells: NDArray[Any] | None = None
        """(rows, columns). None before the first keyframe, and from a missed part to the next keyframe."""
        self.version = 0
        self.header: Any = None
        """Header of the newest part."""

    def apply(self, sample: Sliced[Any]) -> bool:
        """Apply a part. Return whether the map is known now."""
        part = sample.header.part
        version, side, empty = int(part.version), int(part.cells), sample.elements.size == 0
        if part.keyframe == 1 and sample.elements.shape == (side, side):
            self.cells = sample.elements.copy()
        elif self.cells is None or version != self.version + (not empty) or self.cells.shape != (side, side):
            self.cells = None
        elif not empty:
            self.cells[sample.window] = sample.elements
        self.version, self.header = version, sample.header
        return self.cells is not None

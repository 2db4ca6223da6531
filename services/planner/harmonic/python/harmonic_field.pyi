"""Harmonic potential fields on grid maps.

A cell is an index (row, column), as in `free[row, column]`. A position or direction is (x, y): x along columns, y along rows, in
cells. The centre of the cell (row, column) is at x = column, y = row.
"""

from collections.abc import Mapping
from typing import Literal, final

import numpy as np
from numpy.typing import NDArray

_Cell = tuple[int, int]
"""(row, column), both from 0."""

class SolveError(ValueError):
    """A map is invalid, or its solve failed: the message says why and what to do."""

@final
class Verification:
    """What the check of every cell found; without it no field is handed out."""

    worst_residual: float
    """The largest relative residual of a cell's equation; at most 2e-5."""
    worst_tile: float
    """The largest share of the curvature in a tile of 64 x 64 cells that residuals account for; at most 0.01."""
    method: str
    """The method that solved it."""
    reachable: int
    """Cells from which the target can be reached, its own included."""

@final
class Field:
    """A verified field. u is 1 at the target, 0 on blocked cells and outside the map, and the mean of its neighbours elsewhere."""

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
    @property
    def target(self) -> _Cell: ...
    @property
    def u(self) -> NDArray[np.float64]:
        """u of each cell, a new array; 0 also where it is below 1e-308."""
    @property
    def log10_u(self) -> NDArray[np.float64]:
        """log10 of u of each cell over its full range, a new array; -inf where u is 0."""
    @property
    def verification(self) -> Verification: ...

    def guidance(
        self, x: float, y: float
    ) -> tuple[Literal["along", "at_target", "way_out", "unreachable"], tuple[float, float] | None]:
        """Where to go from a position, a unit vector. `way_out` leads from a blocked cell to the nearest one with a path."""
    def direction(self, x: float, y: float) -> tuple[float, float] | None:
        """The direction of `guidance`; None in the target's cell and where no path leads."""
    def directions(self) -> NDArray[np.float64]:
        """The direction at the centre of each cell: an array (rows, columns, 2) of (x, y); (0, 0) where there is none."""
    def path(self, start: _Cell) -> NDArray[np.float64]:
        """Positions (x, y) from the centre of a cell to that of the target: an array (steps, 2).

        Raises SolveError if no path leads there.
        """
    def update(self, changes: Mapping[_Cell, bool]) -> None:
        """Block or free cells and solve again, starting from this field: {(row, column): is it free}.

        Raises SolveError; the field then stays as it was.
        """

def solve(
    free: NDArray[np.bool_],
    target: _Cell,
    screening: float | None = None,
    *,
    threads: int = 1,
    memory_limit: int = 2147483648,
) -> Field:
    """The field of a map: `free` is an array (rows, columns), the target one of its free cells.

    With `screening`, a length in cells, u falls by a further factor of e in that length, and short ways are preferred to wide ones.
    Other threads of Python run meanwhile. Only checks of maps of 512 x 512 cells and more use further `threads`; the result is the
    same. `memory_limit` is in bytes. Raises SolveError, and TypeError for another kind of array.
    """

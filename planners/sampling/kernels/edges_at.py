"""The checks of `planners.sampling.kernels.edges`, for callers that keep the `Body` in a table.

Each takes the address of that table (see `planners.sampling.kernels.addresses`) and the coordinates
of two states. They hold the interpreter lock, as releasing it takes about as long as a check.
"""

from __future__ import annotations

from numba import njit

from groundmap.arrays import Bools, Floats, Ints
from planners.sampling.kernels.addresses import bools_at, floats_at, ints_at
from planners.sampling.kernels.edges import ARM, RADIUS, SIZE, TOUCH, Body, curve_clear, slide_clear
from planners.sampling.kernels.lines import line_clear

# Positions of the fields of `Body` in the table.
BLOCKED, BEFORE, CLEARANCE, CORNERS, BEGINS, DISCS, NUMBERS = range(len(Body._fields))


@njit(cache=True)
def line_clear_at(table: int, ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether a line is clear (`line_clear`) for the disc around base_link and the footprint.

    Parameters
    ----------
    table : int
        Address of the table.
    ax, ay, bx, by : float [m, corner]
        Start and end of the line.
    """
    numbers = floats_at(table, NUMBERS)
    size, radius = numbers[SIZE, 0], numbers[RADIUS, 0] + numbers[ARM, 0]  # either one is 0
    blocked, clearance = bools_at(table, BLOCKED), floats_at(table, CLEARANCE)
    return line_clear(blocked, clearance, size, radius, numbers[TOUCH, 0], ax, ay, bx, by)


@njit(cache=True)
def slide_clear_at(
    table: int, ax: float, ay: float, a: float, bx: float, by: float, b: float
) -> bool:
    """Whether a straight motion is clear (`slide_clear`).

    Parameters
    ----------
    table : int
        Address of the table.
    ax, ay, a, bx, by, b : float [m, m, rad, m, m, rad; corner]
        Its first and last pose.
    """
    return slide_clear(*_body_at(table), ax, ay, a, bx, by, b)


@njit(cache=True)
def dubins_clear_at(
    table: int, ax: float, ay: float, a: float, bx: float, by: float, b: float
) -> bool:
    """Whether a Dubins curve is clear (`curve_clear`).

    Parameters
    ----------
    table : int
        Address of the table.
    ax, ay, a, bx, by, b : float [m, m, rad, m, m, rad; corner]
        Its first and last pose.
    """
    return curve_clear(True, *_body_at(table), ax, ay, a, bx, by, b)


@njit(cache=True)
def reeds_shepp_clear_at(
    table: int, ax: float, ay: float, a: float, bx: float, by: float, b: float
) -> bool:
    """Whether a Reeds-Shepp curve is clear (`curve_clear`).

    Parameters
    ----------
    table : int
        Address of the table.
    ax, ay, a, bx, by, b : float [m, m, rad, m, m, rad; corner]
        Its first and last pose.
    """
    return curve_clear(False, *_body_at(table), ax, ay, a, bx, by, b)


@njit(cache=True)
def _body_at(table: int) -> tuple[Bools, Ints, Floats, Floats, Ints, Floats, Floats]:
    return (
        bools_at(table, BLOCKED),
        ints_at(table, BEFORE),
        floats_at(table, CLEARANCE),
        floats_at(table, CORNERS),
        ints_at(table, BEGINS).ravel(),
        floats_at(table, DISCS),
        floats_at(table, NUMBERS).ravel(),
    )

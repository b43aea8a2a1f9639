"""Odd values: what no caller should give, and what some caller will."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np

from fuzz.draw import Draw

NUMBERS: tuple[Any, ...] = (
    float("nan"), float("inf"), float("-inf"), 0, 0.0, -0.0, -1, -1.0, 1, 2, 3, 0.5, 7.25,
    5e-324, 1e-320, 1e-300, 1e-160, 1e-12, 1e-6, 1e6, 1e8, 1e12, 1e15, 1e18, 1e19, 1e38, 1e39,
    1e155, 1e300, 1.7e308, -1e300, -1e-300, 2**31, 2**31 - 1, -(2**31), 2**32, 2**53 + 1, 2**63,
    2**63 - 1, -(2**63), 2**64, 10**30, 10**400, -(10**400), True, False,
)  # fmt: skip
SCALARS: tuple[Callable[[], Any], ...] = (
    lambda: np.float32(0.5), lambda: np.float16(np.inf), lambda: np.int8(-1),
    lambda: np.bool_(True),
    lambda: np.uint64(2**64 - 1), lambda: np.longdouble(2), lambda: np.array(1.0),
    lambda: np.array([1.0]), lambda: np.array(2), lambda: 1j, lambda: complex(np.nan, 0),
    lambda: np.complex64(1), lambda: Decimal("NaN"), lambda: Decimal("sNaN"),
    lambda: Decimal("1.5"),
    lambda: Decimal("1e999999"), lambda: Fraction(1, 3), lambda: Fraction(10**400),
    lambda: np.datetime64("NaT"), lambda: np.timedelta64(1, "s"),
)  # fmt: skip
OTHERS: tuple[Callable[[], Any], ...] = (
    lambda: None, lambda: "", lambda: "1", lambda: "nan", lambda: "map", lambda: "astar",
    lambda: "a" * 5000, lambda: "a\x00b", lambda: "\ud800", lambda: "\u202egnp.map",
    lambda: "\x1b[2J",
    lambda: b"1", lambda: b"", list, tuple, dict, set, lambda: [1],
    lambda: [[1]], lambda: (1, 2), lambda: (1, 2, 3), lambda: [None, None], lambda: ["a", "b"],
    lambda: [(1, 2), (3,)], lambda: {"x": 1}, lambda: {1, 2}, object, lambda: range(3),
    lambda: iter([1.0, 2.0]), lambda: len, lambda: int, lambda: slice(0, 1), lambda: Ellipsis,
    lambda: np.array([]), lambda: np.zeros((0, 3)), lambda: np.zeros((0, 2)),
    lambda: np.zeros((3, 0)),
    lambda: np.zeros((2, 2, 2)), lambda: np.array(None, dtype=object), lambda: np.array(["a", "b"]),
    lambda: np.array([1 + 1j, 2]), lambda: np.array([None, 1]), lambda: np.array([10**400, 1],
    object),
    lambda: np.array([True, False]), lambda: np.ma.masked_array([1.0, 2.0], [True, False]),
    lambda: np.zeros(2, dtype=[("a", float)]), lambda: np.array(["NaT", "NaT"], "datetime64[s]"),
    lambda: np.zeros((1,) * 20), lambda: np.broadcast_to(1.0, (2,)), lambda: memoryview(b"ab"),
    lambda: [[[[[[1]]]]]], lambda: "9" * 5000, lambda: [10**400, 1],
)  # fmt: skip


def odd(draw: Draw) -> Any:
    """Return an odd value of any type."""
    kind = draw.whole(0, 3)
    if kind <= 1:
        return draw.pick(NUMBERS)
    return draw.pick(SCALARS if kind == 2 else OTHERS)()


def number(draw: Draw, low: float, high: float, share: float = 0.3) -> Any:
    """Return a number between the bounds, or an odd value."""
    return draw.either(share, lambda: odd(draw), lambda: round(draw.number(low, high), 3))


def flag(draw: Draw) -> Any:
    """Return a truth value, or an odd one."""
    return draw.either(0.2, lambda: odd(draw), lambda: draw.chance(0.5))


def word(draw: Draw, *words: str) -> Any:
    """Return one of the words, or an odd value."""
    return draw.either(0.2, lambda: odd(draw), lambda: draw.pick(words))


def array(draw: Draw, plain: Any, share: float = 0.4) -> Any:
    """Return an array as it is, damaged, or an odd value instead."""
    if not draw.chance(share):
        return plain
    if draw.chance(0.2):
        return odd(draw)
    return draw.pick(DAMAGES)(np.array(plain, copy=True), draw)


def _one_entry(values: Any, draw: Draw) -> Any:
    """Return the array with one entry that is odd."""
    entry = draw.pick(NUMBERS)
    if not values.size:
        return values
    place = draw.whole(0, values.size - 1)
    try:
        with np.errstate(over="ignore"):
            values.reshape(-1)[place] = entry
    except (OverflowError, ValueError):
        values = values.astype(object)
        values.reshape(-1)[place] = entry
    return values


def _one_other(values: Any, draw: Draw) -> Any:
    """Return nested lists with one entry that is no number."""
    values = values.astype(object)
    if values.size:
        flat = values.reshape(-1)
        flat[draw.whole(0, values.size - 1) :][:1] = [
            draw.pick((None, "x", "1", 1j, 10**400, True))
        ]
    return values if draw.chance(0.5) else values.tolist()


def _scaled(values: Any, draw: Draw) -> Any:
    """Return the array in other units: huge, tiny, or all the same."""
    if values.dtype.kind not in "fiu":
        return values
    with np.errstate(over="ignore"):
        return values.astype(float) * draw.pick((0.0, -1.0, 1e-9, 1e-3, 1e3, 1e7, 1e20, 1e150))


def _moved(values: Any, draw: Draw) -> Any:
    """Return the array far from the origin."""
    if values.dtype.kind not in "fiu":
        return values
    return values.astype(float) + draw.pick((-5.0, 5.4e6, 1e8, 1e12, 1e17))


def _cast(values: Any, draw: Draw) -> Any:
    """Return the array as another type."""
    kinds = ("f4", "f2", "c16", "O", "U8", "i1", "u8", "?", ">f8", "g", "S4")
    with np.errstate(all="ignore"):
        try:
            return values.astype(draw.pick(kinds))
        except (TypeError, ValueError, OverflowError):
            return values


def _shaped(values: Any, draw: Draw) -> Any:
    """Return the array in another shape."""
    changes: tuple[Callable[[Any], Any], ...] = (
        np.ravel,
        lambda a: a[None],
        lambda a: a[..., None],
        np.transpose,
        lambda a: a[:0],
        lambda a: a[:1],
        lambda a: a[..., :-1],
        lambda a: np.concatenate([a, a], axis=-1) if a.ndim else a,
        lambda a: np.concatenate([a, a[::-1]]) if a.ndim else a,
        lambda a: a[::-1],
        lambda a: a.tolist(),
        lambda a: [a.tolist(), [1]],
        np.asfortranarray,
        lambda a: list(a) if a.ndim else a,
        lambda a: iter(a.tolist()) if a.ndim else a,
    )
    return draw.pick(changes)(values)


DAMAGES: tuple[Callable[[Any, Draw], Any], ...] = (
    _one_entry, _one_entry, _one_entry, _one_other, _scaled, _moved, _cast, _shaped, _shaped,
)  # fmt: skip


def settings(draw: Draw, known: dict[str, Callable[[Draw], Any]], most: int = 3) -> dict[str, Any]:
    """Return some of the settings, each with a plain or an odd value; rarely an unknown one."""
    names = draw.random.sample(sorted(known), min(draw.whole(0, most), len(known)))
    chosen = {name: draw.noted(name, known[name](draw)) for name in names}
    if draw.chance(0.02):
        chosen["resolutoin"] = odd(draw)
    return chosen

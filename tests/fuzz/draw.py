"""Random choices of one case, which its seed repeats."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")
SHOWN = 300  # characters of a value in the record of a failure


class Draw:
    """The random numbers of one case, and a record of the values that it was given.

    Parameters
    ----------
    seed : str
        What names the case: the run's seed, the target and the number of the case.
    """

    def __init__(self, seed: str) -> None:
        self.random = random.Random(seed)
        self.numpy = np.random.default_rng(self.random.getrandbits(64))
        self.record: list[str] = []

    def chance(self, share: float) -> bool:
        """Return True in this share of the cases."""
        return self.random.random() < share

    def pick(self, choices: Sequence[T]) -> T:
        """Return one of the choices."""
        return self.random.choice(choices)

    def whole(self, low: int, high: int) -> int:
        """Return a whole number from low to high, both included."""
        return self.random.randint(low, high)

    def number(self, low: float, high: float) -> float:
        """Return a number between low and high."""
        return self.random.uniform(low, high)

    def noted(self, name: str, value: T) -> T:
        """Return the value, which the record of a failure then shows under that name."""
        self.record.append(f"{name} = {shown(value)}")
        return value

    def either(self, share: float, odd: Callable[[], Any], plain: Callable[[], Any]) -> Any:
        """Return an odd value in this share of the cases, otherwise a plain one."""
        return odd() if self.chance(share) else plain()


def shown(value: object) -> str:
    """Return a value as the record of a failure shows it: printable and of bounded length."""
    try:
        text = repr(value)
    except Exception as error:  # the representation of an odd value may fail in any way
        text = f"<{type(value).__name__} whose repr raises {type(error).__name__}>"
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}... ({len(text)} characters)"

"""What somebody who waits for a search is told, and when they have heard enough."""

from __future__ import annotations

import math

import numpy as np

from groundmap.arrays import Floats
from planners.search.base import Clock, Improvement, OnImproved

UNTOLD: Floats = np.empty((0, 2))  # waypoints of a route that OMPL doesn't show yet


class ImprovementReporter:
    """Tells of every better route.

    Parameters
    ----------
    clock : Clock
    tell : callable, optional
        As in `planners.plan`.

    Attributes
    ----------
    cost : float
        Of the best route so far; infinite before the first.
    since : float [s]
        When the first route came; infinite before.
    enough : bool
        Whether who was told wants no better one.
    fault : int or None
        The `id` of what who was told has raised; kept itself, it would keep OMPL's objects.
    """

    def __init__(self, clock: Clock, tell: OnImproved | None) -> None:
        self.clock, self.tell = clock, tell
        self.cost, self.since, self.enough = math.inf, math.inf, False
        self.fault: int | None = None

    def report(self, cost: float, waypoints: Floats = UNTOLD) -> None:
        """Take note of a route, and tell of it if it is better than those before."""
        if cost < self.cost:
            self._say(cost, waypoints)

    def ends(self, cost: float, waypoints: Floats) -> None:
        """Tell of the route that is handed out: the last word, with its waypoints."""
        self._say(min(cost, self.cost), waypoints)

    def has_had(self, seconds: float) -> bool:
        """Whether so much time has passed since the first route."""
        return self.clock.seconds - self.since >= seconds

    def _say(self, cost: float, waypoints: Floats) -> None:
        self.cost, self.since = cost, min(self.since, self.clock.seconds)
        if self.tell is None or self.enough:
            return
        try:
            enough = self.tell(Improvement(cost, math.inf, self.clock.seconds, waypoints))
        except BaseException as error:
            self.fault = id(error)
            raise
        self.enough = bool(enough)

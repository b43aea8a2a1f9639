"""Reports of improved routes to the caller of an anytime search."""

from __future__ import annotations

import math

import numpy as np

from groundmap.arrays import Floats
from planners.search.base import Clock, Improvement, OnImproved

NO_WAYPOINTS: Floats = np.empty((0, 2))  # of routes that OMPL does not expose while it searches


class ImprovementReporter:
    """Calls back with each route that is cheaper than all before.

    Parameters
    ----------
    clock : Clock
    callback : callable, optional
        As `on_improved` of `planners.plan`.

    Attributes
    ----------
    cost : float
        Of the best route so far; infinite before the first.
    first_at : float [s]
        Time of the first route; infinite before.
    should_stop : bool
        Whether the callback asked to stop.
    error_id : int or None
        The `id` of an error that the callback raised. The error itself is not stored: its traceback
        would keep OMPL's objects alive.
    """

    def __init__(self, clock: Clock, callback: OnImproved | None) -> None:
        self.clock, self.callback = clock, callback
        self.cost, self.first_at, self.should_stop = math.inf, math.inf, False
        self.error_id: int | None = None

    def report(self, cost: float, waypoints: Floats = NO_WAYPOINTS) -> None:
        """Report a route if it is cheaper than all before.

        Parameters
        ----------
        cost : float
        waypoints : ndarray, shape (n, 2) or (n, 3) [m, map], optional
        """
        if cost < self.cost:
            self._call(cost, waypoints)

    def report_final(self, cost: float, waypoints: Floats) -> None:
        """Report the route that is returned; this is the last call.

        Parameters
        ----------
        cost : float
        waypoints : ndarray, shape (n, 2) or (n, 3) [m, map]
        """
        self._call(min(cost, self.cost), waypoints)

    def has_improved_for(self, seconds: float) -> bool:
        """Whether this time [s] has passed since the first route."""
        return self.clock.seconds - self.first_at >= seconds

    def _call(self, cost: float, waypoints: Floats) -> None:
        self.cost, self.first_at = cost, min(self.first_at, self.clock.seconds)
        if self.callback is None or self.should_stop:
            return
        try:
            should_stop = self.callback(Improvement(cost, math.inf, self.clock.seconds, waypoints))
        except BaseException as error:
            self.error_id = id(error)
            raise
        self.should_stop = bool(should_stop)

"""Figures of maps from held-out features, and the sums behind them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True)
class Figures:
    """Agreement of maps with held-out features: shares from 0 to 1, pooled over the five folds."""

    obstacle_near_nonfree: float  #: share of obstacles within 0.3 m of a non-free cell
    obstacle_in_free: float  #: share of obstacles in free cells
    obstacle_unknown: float  #: share of obstacles in unknown or contested cells
    ground_free: float  #: share of ground features in free cells
    ground_nonfree: float  #: share of ground features in non-free cells
    ground_unknown: float  #: share of ground features in unknown or contested cells
    sightline_free: float  #: share of the length of sight lines to ground features in free cells
    sightline_crosses_nonfree: float  #: share of these lines that cross a non-free cell
    trajectory_free: float  #: share of free cells on the trajectory, from its first known cell
    trajectory_nonfree: float  #: share of non-free cells on the same part of the trajectory
    trajectory_unseen_start_m: float  #: [m], trajectory before its first known cell, mean of folds
    swept_free: float  #: share of free cells within 0.8 m of the trajectory, beyond its first 5 m
    swept_nonfree: float  #: share of non-free cells there
    moving_in_free: float  #: share of obstacles that move in free cells
    moving_near_nonfree: float  #: share of these within 0.3 m of a non-free cell
    thin_in_free: float  #: share of obstacles with few landmarks around them in free cells
    thin_near_nonfree: float  #: share of these within 0.3 m of a non-free cell
    obstacles: int  #: number of obstacles
    moving: int  #: number of those that move
    thin: int  #: number of those with few landmarks around them
    grounds: int  #: number of ground features


class Tally(NamedTuple):
    """Sums behind the `Figures`; the tallies of several folds are added field by field."""

    obstacles: float = 0
    near_nonfree: float = 0
    in_free: float = 0
    obstacles_unknown: float = 0
    grounds: float = 0
    grounds_free: float = 0
    grounds_nonfree: float = 0
    grounds_unknown: float = 0
    sight_m: float = 0
    sight_free_m: float = 0
    crossings: float = 0
    driven: float = 0
    driven_free: float = 0
    driven_nonfree: float = 0
    unseen_start_m: float = 0
    maps: float = 0
    swept: float = 0
    swept_free: float = 0
    swept_nonfree: float = 0
    moving: float = 0
    moving_in_free: float = 0
    moving_near: float = 0
    thin: float = 0
    thin_in_free: float = 0
    thin_near: float = 0

    def plus(self, other: Tally) -> Tally:
        """Return the field-wise sum of two tallies."""
        return Tally(*(a + b for a, b in zip(self, other, strict=True)))

    def figures(self) -> Figures:
        """Return the figures; shares without any data are 0."""

        def share(part: float, whole: float) -> float:
            return part / whole if whole else 0.0

        return Figures(
            obstacle_near_nonfree=share(self.near_nonfree, self.obstacles),
            obstacle_in_free=share(self.in_free, self.obstacles),
            obstacle_unknown=share(self.obstacles_unknown, self.obstacles),
            ground_free=share(self.grounds_free, self.grounds),
            ground_nonfree=share(self.grounds_nonfree, self.grounds),
            ground_unknown=share(self.grounds_unknown, self.grounds),
            sightline_free=share(self.sight_free_m, self.sight_m),
            sightline_crosses_nonfree=share(self.crossings, self.grounds),
            trajectory_free=share(self.driven_free, self.driven),
            trajectory_nonfree=share(self.driven_nonfree, self.driven),
            trajectory_unseen_start_m=share(self.unseen_start_m, self.maps),
            swept_free=share(self.swept_free, self.swept),
            swept_nonfree=share(self.swept_nonfree, self.swept),
            moving_in_free=share(self.moving_in_free, self.moving),
            moving_near_nonfree=share(self.moving_near, self.moving),
            thin_in_free=share(self.thin_in_free, self.thin),
            thin_near_nonfree=share(self.thin_near, self.thin),
            obstacles=int(self.obstacles),
            moving=int(self.moving),
            thin=int(self.thin),
            grounds=int(self.grounds),
        )

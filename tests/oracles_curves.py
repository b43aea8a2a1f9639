"""Slow twins of the shortest curves, and a check of routes that a robot is to steer.

Nothing here knows the formulas: words are driven piece by piece, and searched.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise, product
from typing import TypeAlias

import numpy as np
import shapely
from scipy.optimize import minimize

from groundmap.arrays import Floats
from planners.costmap.costmap import Costmap
from planners.search.base import SearchResult
from planners.search.hybrid_astar import HybridAStarSettings

Pose: TypeAlias = tuple[float, float, float]


def drive(pose: Sequence[float], curvature: float, length: float) -> Pose:
    """Return where a piece of constant curvature leads: by turning about its centre."""
    x, y, yaw = pose
    if curvature == 0.0:
        return x + length * math.cos(yaw), y + length * math.sin(yaw), yaw
    radius, after = 1.0 / curvature, yaw + curvature * length
    centre = x - radius * math.sin(yaw), y + radius * math.cos(yaw)
    return (
        centre[0] + radius * math.sin(after),
        centre[1] - radius * math.cos(after),
        after,
    )


def end_of(start: Sequence[float], pieces: Iterable[tuple[float, float]]) -> Pose:
    """Return where pieces (curvature, length) lead."""
    pose = (start[0], start[1], start[2])
    for curvature, length in pieces:
        pose = drive(pose, curvature, length)
    return pose


def gap(a: Sequence[float], b: Sequence[float]) -> float:
    """Return how far two poses are apart: the largest of the differences in x, y and yaw."""
    turn = math.remainder(a[2] - b[2], 2.0 * math.pi)
    return max(abs(a[0] - b[0]), abs(a[1] - b[1]), abs(turn))


def searched_length(goal: Pose, *, forward: bool, seed: int) -> float:
    """Return the length of the shortest curve from the origin that a blind search finds.

    Turning radius 1. Words of three of the letters L, S and R are driven with free lengths, from
    random ones on, until they end at the goal.
    """
    rng = np.random.default_rng(seed)
    best = math.inf
    words = [word for word in product((1.0, 0.0, -1.0), repeat=3) if _changes(word)]
    gears = product((1.0,) if forward else (1.0, -1.0), repeat=3)
    for word, signs in product(words, gears):
        for _ in range(3 if forward else 1):
            found = minimize(
                lambda lengths, signs: float(lengths @ signs),
                signs * rng.uniform(0.0, 4.0, 3),
                args=(signs,),
                method="SLSQP",
                options={"maxiter": 40},
                bounds=[(0.0, 6.3) if sign > 0 else (-6.3, 0.0) for sign in signs],
                constraints={"type": "eq", "fun": _misses, "args": (word, goal)},
            )
            if found.success and np.abs(_misses(found.x, word, goal)).max() < 1e-6:
                best = min(best, float(np.abs(found.x).sum()))
    return best


def _changes(word: Sequence[float]) -> bool:
    return all(a != b for a, b in pairwise(word))


def _misses(lengths: Floats, word: Sequence[float], goal: Pose) -> Floats:
    x, y, yaw = end_of((0.0, 0.0, 0.0), zip(word, lengths.tolist(), strict=True))
    return np.array([x - goal[0], y - goal[1], math.sin((yaw - goal[2]) / 2.0)])


def check_steered(
    costmap: Costmap,
    found: SearchResult,
    ends: Sequence[Sequence[float]],
    settings: HybridAStarSettings,
) -> None:
    """Check a route of poses: its ends, its steps, its curvature, and all that it sweeps."""
    poses, turns, chords = _poses(found)
    for index, pose in ((0, ends[0]), (-1, ends[1])):
        assert tuple(poses[index]) == tuple(pose)
    assert chords.max() <= 0.5 * costmap.window.resolution + 1e-9
    # Chord and turn of an arc of radius r: 2 r sin(turn / 2).
    shortest = 2.0 * settings.turning_radius * np.sin(np.abs(turns) / 2.0)
    assert (chords >= shortest * (1 - 1e-6) - 1e-12).all()
    steps, middle = np.diff(poses[:, :2], axis=0), poses[:-1, 2] + turns / 2.0
    across = steps[:, 1] * np.cos(middle) - steps[:, 0] * np.sin(middle)
    ahead = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
    assert np.abs(across).max() <= 1e-9
    if settings.motion == "dubins":
        assert ahead.min() >= -1e-9
    _check_swept(costmap, poses, turns)


def _poses(found: SearchResult) -> tuple[Floats, Floats, Floats]:
    assert found.headings is not None
    poses = np.column_stack([found.waypoints, found.headings])
    turns = np.remainder(np.diff(poses[:, 2]) + np.pi, 2.0 * np.pi) - np.pi
    return poses, turns, np.hypot(*np.diff(poses[:, :2], axis=0).T)


def _check_swept(costmap: Costmap, poses: Floats, turns: Floats) -> None:
    size, footprint = costmap.window.resolution, costmap.problem.shape
    cells = np.argwhere(costmap.blocked)[:, ::-1]
    low = costmap.window.origin + cells * size
    squares = shapely.box(*low.T, *(low + size).T)
    if footprint.polygon is None:
        line = shapely.LineString(poses[:, :2])
        assert shapely.distance(line, shapely.union_all(squares)) >= footprint.radius - 1e-9
        return
    bulges = footprint.radius * (1.0 - np.cos(turns / 2.0))
    assert bulges.max() <= 1e-3
    whole = shapely.Polygon(footprint.polygon)
    parts = [whole]
    if not whole.equals(whole.convex_hull):
        parts = list(shapely.get_parts(shapely.constrained_delaunay_triangles(whole)))
    tree = shapely.STRtree(squares)
    for part in parts:
        placed = [placed_at(part, pose) for pose in poses]
        pairs = [shapely.union(a, b) for a, b in pairwise(placed)]
        swept = shapely.buffer(shapely.convex_hull(pairs), bulges - 1e-9)
        hulls, near = tree.query(swept, predicate="intersects")
        overlaps = shapely.area(shapely.intersection(swept[hulls], squares[near]))
        assert overlaps.max(initial=0.0) <= 1e-9


def placed_at(polygon: shapely.Polygon, pose: Sequence[float] | Floats) -> shapely.Polygon:
    """Return a polygon in base_link at a pose."""
    x, y, yaw = pose
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    return shapely.transform(polygon, lambda points: points @ turn.T + (x, y))

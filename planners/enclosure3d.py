"""Why there is no route in 3-D: who is fenced in, and how far one gets."""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage

from groundmap.arrays import Bools
from planners.answers import check_start_is_known
from planners.errors import EnclosedError
from planners.voxels import Voxels
from planners.wording import Place, Point


def enclosed_3d(voxels: Voxels) -> EnclosedError:
    """Return the exception that says why start and goal are not joined.

    Raises
    ------
    UnknownSpaceError
        The start is an island in unknown space.
    """
    problem, resolution = voxels.problem, voxels.window.resolution
    # All voxels of a move's box must be free: whoever gets anywhere gets there over faces.
    parts, _ = ndimage.label(voxels.stand)
    from_start, from_goal = (
        _around(voxels, parts, xyz) for xyz in (problem.start_xy, problem.goal_xy)
    )
    check_start_is_known(voxels)
    place: Place = "start" if from_start.sum() < from_goal.sum() else "goal"
    fenced = from_start if place == "start" else from_goal
    centres = voxels.window.cell_to_world(np.argwhere(from_start))
    places = centres if len(centres) else np.array([problem.start_xy])
    distances = np.linalg.norm(places - problem.goal_xy, axis=1)
    nearest = int(distances.argmin())
    return EnclosedError(
        place,
        area=float(fenced.sum()) * resolution**3,
        nearest=tuple(places[nearest].tolist()),
        distance=float(distances[nearest]),
        widest_gap=math.nan,
        needed=2.0 * problem.radius,
    )


def _around(voxels: Voxels, parts: Bools, xyz: Point) -> Bools:
    """Return the voxels that can be reached from those around a place."""
    position = voxels.to_cells(xyz)[0][::-1] - 0.5
    low, high = np.floor(position).astype(int), np.ceil(position).astype(int)
    box = tuple(slice(max(i, 0), j + 1) for i, j in zip(low, high, strict=True))
    near = np.unique(parts[box])
    reached: Bools = np.isin(parts, near[near > 0])
    return reached

"""Lines of sight in the ground plane: surfaces that they cross, and gaps between them.

The viewpoint is the origin. Lines are sorted by bearing.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Floats

WIDEST_GAP = 1.5  # [rad], between two lines: a chord must not pass the viewpoint
SAME_BEARING = 1e-9  # [rad]: what differs by less is rounding
SAME_RANGE = 1e-9  # [m]
NARROWEST_GAP = 1e-9  # [rad], between two lines; least angle of a surface


@njit(cache=True, nogil=True)
def count_contradicting(
    ends: Floats,
    reach: Floats,
    tops: Floats,
    bearings: Floats,
    points: Floats,
    heights: Floats,
    shares: Floats,
    camera_height: float,
    behind: float,
    below: float,
    against: Floats,
    passes: Bools,
) -> None:
    """Count the features behind each surface that are seen below its top.

    Parameters
    ----------
    ends : ndarray, shape (s, 2, 2)
        Surfaces, counter-clockwise around the viewpoint.
    reach, tops : ndarray, shape (s, 2)
        Values at both ends of the surfaces.
    bearings, points, heights, shares : ndarray, shapes (n,), (n, 2), (n,), (n,)
        Features sorted by bearing, and the weight of each row.
    camera_height, behind, below : float
        A feature is behind a surface if the distance exceeds twice the reach plus `behind`; it is
        seen below the top if its line of sight passes more than `below` under it.
    against : ndarray, shape (s,)
        Counts, increased in place.
    passes : ndarray of bool, shape (n,)
        Set where a feature is seen through any surface.
    """
    ranges = np.hypot(points[:, 0], points[:, 1])
    for s in range(len(ends)):
        x0, y0 = ends[s, 0, 0], ends[s, 0, 1]
        ex, ey = ends[s, 1, 0] - x0, ends[s, 1, 1] - y0
        first, last = np.arctan2(y0, x0), np.arctan2(ends[s, 1, 1], ends[s, 1, 0])
        if last - first < NARROWEST_GAP:  # seen end-on, or across the seam, behind the camera
            continue
        square = ex * ex + ey * ey
        # A feature at the bearing of an end is seen through the surface, up to rounding.
        row = np.searchsorted(bearings, first - SAME_BEARING)
        while row < len(bearings) and bearings[row] <= last + SAME_BEARING:
            x, y = points[row, 0], points[row, 1]
            row += 1
            facing = x * ey - y * ex
            if facing == 0.0:
                continue
            share = (x0 * ey - y0 * ex) / facing  # range of the surface / of the feature
            if share >= 1.0:  # in front of the surface
                continue
            t = ((x * share - x0) * ex + (y * share - y0) * ey) / square
            t = min(max(t, 0.0), 1.0)
            away = (1.0 - share) * ranges[row - 1]
            if away <= 2.0 * ((1 - t) * reach[s, 0] + t * reach[s, 1]) + behind:
                continue
            sight = camera_height + (heights[row - 1] - camera_height) * share
            if sight < (1 - t) * tops[s, 0] + t * tops[s, 1] - below:
                against[s] += shares[row - 1]
                passes[row - 1] = True


@njit(cache=True, nogil=True)
def features_beside(
    rays: Floats, first: Floats, last: Floats, points: Floats, width: float, beside: Bools
) -> None:
    """Find the lines of sight with a point beside them.

    Parameters
    ----------
    rays : ndarray, shape (n, 2)
        Unit vectors along the lines.
    first, last : ndarray, shape (n,)
        Bounds of a point's distance along the line.
    points : ndarray, shape (k, 2)
    width : float
        Bound of a point's distance from the line.
    beside : ndarray of bool, shape (n,)
        Result, set in place.
    """
    for i in range(len(rays)):
        x, y = rays[i]
        beside[i] = False
        for k in range(len(points)):
            if abs(x * points[k, 1] - y * points[k, 0]) < width:
                along = x * points[k, 0] + y * points[k, 1]
                if first[i] < along < last[i]:
                    beside[i] = True
                    break


@njit(cache=True, nogil=True)
def gap_chords(
    bearings: Floats, ranges: Floats, heights: Floats, eye: float, widest: float
) -> tuple[Floats, Floats]:
    """Return the chords between neighbouring lines of sight.

    Two lines are neighbours at a range if all lines between them are shorter. Their chord lies at
    the largest range that both reach and at which they are at most `widest` apart.

    Parameters
    ----------
    bearings, ranges, heights : ndarray, shape (n,)
        Bearing [rad], length [m] and height at the end [m] of each line.
    eye : float [m]
        Height of the lines at the viewpoint.
    widest : float [m]

    Returns
    -------
    chords : ndarray, shape (k, 2, 2) [m]
        Counter-clockwise.
    ends : ndarray, shape (k, 2) [m]
        Heights of the lines at the ends of the chords.
    """
    count = len(bearings)
    chords, ends = np.empty((2 * count, 2, 2)), np.empty((2 * count, 2))
    stack = np.empty(count, np.int64)  # lines that may have another neighbour to the left
    size, top = 0, 0
    for j in range(count):
        while top > 0:
            i = stack[top - 1]
            gap = bearings[j] - bearings[i]
            if NARROWEST_GAP < gap < WIDEST_GAP:
                radius = min(ranges[i], ranges[j], 0.5 * widest / np.sin(0.5 * gap))
                for side, line in ((0, i), (1, j)):
                    chords[size, side, 0] = radius * np.cos(bearings[line])
                    chords[size, side, 1] = radius * np.sin(bearings[line])
                    ends[size, side] = eye + (heights[line] - eye) * (radius / ranges[line])
                size += 1
            if ranges[i] > ranges[j] + SAME_RANGE:
                break
            top -= 1
        stack[top] = j
        top += 1
    return chords[:size], ends[:size]


@njit(cache=True, nogil=True)
def climb_down(
    radius: Floats,
    places: Floats,
    heights: Floats,
    below: Bools,
    across: float,
    widening: float,
    longest: float,
    steepest: float,
    slack: float,
    reached: Bools,
) -> None:
    """Mark features below the ground that a gentle slope leads down to.

    A slope leads from feature to feature, away from the camera, from one that is ground.

    Parameters
    ----------
    radius : ndarray, shape (n,) [m]
        Ascending distances of the features from the camera.
    places : ndarray, shape (n, 2) [m, view]
    heights : ndarray, shape (n,) [m]
    below : ndarray of bool, shape (n,)
        Features below the ground; the others are ground.
    across : float [m]
        Largest distance of a feature from the line of sight to the next one.
    widening : float
        The same per distance of the next one from the camera, where that is more.
    longest : float [m]
        Largest distance between the two along that line.
    steepest : float
        Largest drop per distance along the line.
    slack : float [m]
        What a drop may be larger by.
    reached : ndarray of bool, shape (n,)
        Set; False for features that are ground.
    """
    reached[:] = False
    for row in range(len(radius)):
        if not below[row]:
            continue
        x, y = places[row] / radius[row]
        beside = max(across, widening * radius[row])
        for other in range(row - 1, -1, -1):
            if radius[other] < radius[row] - longest - beside:
                break
            if below[other] and not reached[other]:
                continue
            gap = radius[row] - (x * places[other, 0] + y * places[other, 1])
            side = abs(x * places[other, 1] - y * places[other, 0])
            if side > beside or gap <= 0 or gap > longest:
                continue
            if heights[other] - heights[row] <= steepest * gap + slack:
                reached[row] = True
                break

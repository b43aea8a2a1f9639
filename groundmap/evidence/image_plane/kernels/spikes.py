"""Repair of spikes: vertices behind the plane that their neighbours agree on."""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Floats, Ints

FEWEST = 4  # neighbours that agree on a plane; three always do
MOST = 64  # neighbours of a vertex that are looked at
LEAST_AREA = 1e-9  # of the ellipse that neighbours spread over, relative: less is a line


@njit(cache=True, nogil=True)
def repair_spikes(
    points: Floats,
    inverse: Floats,
    sigma: Floats,
    edges: Ints,
    spike: float,
    agreement: float,
    repaired: Floats,
) -> int:
    """Move vertices far behind the plane of their neighbours onto it; return how many.

    Parameters
    ----------
    points : ndarray, shape (v, 2) [px]
    inverse, sigma : ndarray, shape (v,) [1/m]
        Inverse depths and their standard deviations.
    edges : ndarray, shape (e, 2)
    spike : float
        Standard deviations behind the plane from which a vertex is a spike.
    agreement : float
        Standard deviations from the plane within which neighbours agree. One that does not is left
        out, if four others remain.
    repaired : ndarray, shape (v,) [1/m]
        `inverse`, is changed in place.
    """
    starts, others = _neighbours(len(points), edges)
    number = 0
    near = np.empty(MOST, dtype=np.int64)
    for i in range(len(points)):
        count = min(starts[i + 1] - starts[i], MOST)
        for k in range(count):
            near[k] = others[starts[i] + k]
        while count >= FEWEST:
            a, b, c, variance, sound = _plane(points, inverse, sigma, near, count, points[i])
            if not sound:
                break
            worst, at = 0.0, 0
            for k in range(count):
                j = near[k]
                x, y = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
                off = abs(inverse[j] - (a * x + b * y + c)) / sigma[j]
                if off > worst:
                    worst, at = off, k
            if worst <= agreement:
                if c - inverse[i] > spike * np.sqrt(variance + sigma[i] ** 2) and c > 0.0:
                    repaired[i] = c
                    number += 1
                break
            count -= 1
            near[at] = near[count]
    return number


@njit(cache=True, nogil=True)
def _neighbours(count: int, edges: Ints) -> tuple[Ints, Ints]:
    """Return where the neighbours of each vertex start, shape (v + 1,), and all of them."""
    starts = np.zeros(count + 1, dtype=np.int64)
    for e in range(len(edges)):
        starts[edges[e, 0] + 1] += 1
        starts[edges[e, 1] + 1] += 1
    for i in range(count):
        starts[i + 1] += starts[i]
    others = np.empty(2 * len(edges), dtype=np.int64)
    filled = starts[:count].copy()
    for e in range(len(edges)):
        for k in range(2):
            i = edges[e, k]
            others[filled[i]] = edges[e, 1 - k]
            filled[i] += 1
    return starts, others


@njit(cache=True, nogil=True)
def _plane(
    points: Floats, inverse: Floats, sigma: Floats, near: Ints, count: int, at: Floats
) -> tuple[float, float, float, float, bool]:
    """Fit inverse = a x + b y + c around a point; also the variance of c, and if it is defined."""
    sw = sx = sy = sxx = sxy = syy = sd = sxd = syd = 0.0
    for k in range(count):
        j = near[k]
        w = 1.0 / (sigma[j] * sigma[j])
        x, y, d = points[j, 0] - at[0], points[j, 1] - at[1], inverse[j]
        sw += w
        sx += w * x
        sy += w * y
        sxx += w * x * x
        sxy += w * x * y
        syy += w * y * y
        sd += w * d
        sxd += w * x * d
        syd += w * y * d
    # About the weighted mean, where the system falls apart into a slope and a level.
    mx, my, md = sx / sw, sy / sw, sd / sw
    cxx, cxy, cyy = sxx / sw - mx * mx, sxy / sw - mx * my, syy / sw - my * my
    cxd, cyd = sxd / sw - mx * md, syd / sw - my * md
    area = cxx * cyy - cxy * cxy
    if not area > LEAST_AREA * (cxx + cyy) ** 2:
        return 0.0, 0.0, 0.0, 0.0, False
    a, b = (cyy * cxd - cxy * cyd) / area, (cxx * cyd - cxy * cxd) / area
    spread = (cyy * mx * mx - 2.0 * cxy * mx * my + cxx * my * my) / area
    return a, b, md - a * mx - b * my, (1.0 + spread) / sw, True

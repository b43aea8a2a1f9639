"""Features of one view in its image: pixels, inverse depths and how sure these are.

Inverse depth is linear over the image of a plane, and the noise of a disparity is that of an
inverse depth: everything between features is interpolated in it.
"""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Bools, Floats, Ints
from groundmap.evidence.image_plane.kernels.spikes import repair_spikes
from groundmap.evidence.triangulation import Mesh
from groundmap.evidence.uncertainty import MODELS
from groundmap.settings import MapperSettings
from groundmap.view.view import Features, View

WIDEST = np.tan(np.radians(80.0))  # tangent of the bearing and elevation of features in the image
MERGED_PX = 0.5  # [px], nearer features are one vertex
SPIKE_SIGMAS = 4.0  # a vertex this far behind its neighbours' plane is a false match
AGREEMENT_SIGMAS = 3.0  # of neighbours that lie on one plane
LEAST_RELATIVE = 1e-9  # of the inverse depth, its least standard deviation


class ImageFeatures(NamedTuple):
    """Points and both ends of segments in the image of one view."""

    focal: float  #: [px]
    px: Floats  #: shape (n, 2) [px], from the principal point: right, down
    inverse: Floats  #: shape (n,) [1/m], inverse depth
    relative: Floats  #: shape (n,), standard deviation of the range, as a share of it
    noise: Floats  #: shape (n,), the same whatever the uncertainty model is
    segments: Ints  #: shape (m, 2), rows of `px`
    used: int  #: features that are in the above
    dropped: Counter[str]  #: features that are not, by reason


class Vertices(NamedTuple):
    """Vertices of the triangulation of the image."""

    px: Floats  #: shape (v, 2) [px], from the principal point
    inverse: Floats  #: shape (v,) [1/m], inverse depth
    reach: Floats  #: shape (v,), extent of the spread along the ray, as a share of the range
    spikes: int  #: vertices that were moved onto the plane of their neighbours


def project(view: View, settings: MapperSettings) -> ImageFeatures:
    """Project the features of a view to its image.

    Features nearer than `min_range` are dropped, as are those whose standard deviation is above
    their range and those more than 80 degrees off the optical axis. Features beyond `max_range`
    are kept: the space before them is free.

    Parameters
    ----------
    view : View
    settings : MapperSettings
    """
    dropped = Counter(view.dropped)
    lasting = (view.segments.xyz[:, 0] != view.segments.xyz[:, 1]).any(axis=1)
    dropped["zero_length"] += int((~lasting).sum())
    points, segments = view.points, view.segments.select(lasting)
    kept = [_usable(features, settings, dropped) for features in (points, segments)]
    points, segments = points.select(kept[0]), segments.select(kept[1])
    xyz = np.concatenate([points.xyz, segments.xyz.reshape(-1, 3)])
    covariance = np.concatenate([points.covariance, segments.covariance.reshape(-1, 3, 3)])
    distance = _length(xyz)
    sigma = MODELS[settings.uncertainty].sigma(xyz, covariance)
    ends = np.arange(len(points), len(xyz), dtype=np.int64)
    return ImageFeatures(
        focal=view.rig.fx,
        px=view.rig.fx * xyz[:, :2] / xyz[:, 2:],
        inverse=1.0 / xyz[:, 2],
        relative=sigma / distance,
        noise=MODELS["ellipsoid"].sigma(xyz, covariance) / distance,
        segments=ends.reshape(-1, 2),
        used=len(points) + len(segments),
        dropped=+dropped,
    )


def _length(xyz: Floats) -> Floats:
    length: Floats = np.sqrt(np.einsum("...i,...i->...", xyz, xyz))
    return length


def _usable(features: Features, settings: MapperSettings, dropped: Counter[str]) -> Bools:
    """Return which features are used, and count the others by reason."""
    xyz = features.xyz.reshape(len(features), features.xyz.size // max(3 * len(features), 1), 3)
    with np.errstate(over="ignore"):
        outside = (np.abs(xyz[..., :2]) > WIDEST * xyz[..., 2:]).any(axis=(1, 2))
        distance = _length(xyz)
        covariance = features.covariance.reshape(*xyz.shape, 3)
        sigma = np.sqrt(np.maximum(np.trace(covariance, axis1=-2, axis2=-1), 0.0))
    near = ~outside & (distance < settings.min_range).any(axis=1)
    unsure = ~outside & ~near & (sigma > distance).any(axis=1)
    dropped["outside_image"] += int(outside.sum())
    dropped["too_near"] += int(near.sum())
    dropped["too_uncertain"] += int(unsure.sum())
    usable: Bools = ~(outside | near | unsure)
    return usable


def vertices_of(features: ImageFeatures, mesh: Mesh, settings: MapperSettings) -> Vertices:
    """Return the vertices of a triangulation of features, with spikes repaired.

    The nearest of several features in one pixel counts, and the nearer of two segments where they
    cross. A vertex more than four standard deviations behind the plane that its neighbours agree on
    is moved onto it.

    Parameters
    ----------
    features : ImageFeatures
    mesh : Mesh
        Of `ImageFeatures.px` and its segments.
    settings : MapperSettings
    """
    count = len(mesh.points)
    nearest = np.full(count, -1, dtype=np.int64)
    order = np.argsort(features.inverse, kind="stable")
    nearest[mesh.source[order]] = order
    own = nearest >= 0
    inverse, relative, noise = np.zeros(count), np.zeros(count), np.zeros(count)
    inverse[own] = features.inverse[nearest[own]]
    relative[own] = features.relative[nearest[own]]
    noise[own] = features.noise[nearest[own]]
    _cross(mesh, inverse, relative, noise)
    repaired = inverse.copy()
    spikes = repair_spikes(
        mesh.points,
        inverse,
        np.maximum(noise, LEAST_RELATIVE) * inverse,
        mesh.edges,
        SPIKE_SIGMAS,
        AGREEMENT_SIGMAS,
        repaired,
    )
    # No surface spreads farther than features are used, whatever sigma is.
    stretch = np.sqrt(1.0 + (mesh.points**2).sum(axis=1) / features.focal**2)
    most = settings.max_range * repaired / stretch
    reach = np.minimum(settings.spread_sigmas * relative, most)
    return Vertices(mesh.points, repaired, reach, int(spikes))


def _cross(mesh: Mesh, inverse: Floats, relative: Floats, noise: Floats) -> None:
    """Give vertices inside segments, in place, what the nearest of the segments has there."""
    if len(mesh.crossings) == 0:
        return
    vertex, a, b = mesh.crossings.T
    along = mesh.points[b] - mesh.points[a]
    length = np.maximum((along**2).sum(axis=1), np.finfo(np.float64).tiny)
    share = ((mesh.points[vertex] - mesh.points[a]) * along).sum(axis=1) / length
    share = np.clip(share, 0.0, 1.0)
    there = [values[a] * (1.0 - share) + values[b] * share for values in (inverse, relative, noise)]
    order = np.argsort(there[0], kind="stable")
    order = order[there[0][order] > inverse[vertex[order]]]
    for values, at in zip((inverse, relative, noise), there, strict=True):
        values[vertex[order]] = at[order]

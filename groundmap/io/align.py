"""Scale and level of a log: its views in metres, with z up."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, as_number
from groundmap.errors import InputError, NoGroundPlaneError
from groundmap.io.log import ViewLog
from groundmap.io.readers.base import SparseMapLog
from groundmap.sparse.ground_estimate import GroundEstimate, estimate_ground
from groundmap.sparse.similarity import Similarity
from groundmap.sparse.sparse_map import SparseMap
from groundmap.view.view import View


class ScalePoints(NamedTuple):
    """Two places of a sparse map whose distance is known."""

    first: str  #: id of a landmark, name of a view, or ``X,Y,Z`` in the world of the file
    second: str
    distance: float  #: [m]


class AlignedViews:
    """The views of a log after a rotation and a scale, which can be iterated over repeatedly.

    Parameters
    ----------
    log : ViewLog
    similarity : Similarity
    ground : GroundEstimate, optional
        The ground of the log before, if it was estimated.
    """

    def __init__(
        self, log: ViewLog, similarity: Similarity, ground: GroundEstimate | None = None
    ) -> None:
        self.log, self.similarity, self.ground = log, similarity, ground

    def __len__(self) -> int:
        return len(self.log)

    def __iter__(self) -> Iterator[View]:
        return (self.similarity.apply(view) for view in self.log)


def is_metric(log: ViewLog) -> bool:
    """Return whether the unit of a log is known to be the metre."""
    return not isinstance(log, SparseMapLog) or log.sparse.metric


def align(
    log: ViewLog,
    *,
    scale: float | None = None,
    camera_height: float | None = None,
    scale_points: ScalePoints | None = None,
    level: bool | None = None,
) -> AlignedViews:
    """Return the views of a log in metres, and with z perpendicular to the ground.

    Parameters
    ----------
    log : ViewLog
    scale : float, optional
        Metres per unit of the log.
    camera_height : float, optional [m]
        Mean height of the cameras above the ground, which gives the scale.
    scale_points : ScalePoints, optional
        Two places and their distance, which give the scale; of a sparse map only.
    level : bool, optional
        Whether to turn the log so that the ground under its cameras is level; default: for sparse
        maps, unless their unit and their direction up are known.

    Raises
    ------
    InputError
        More than one of the options that give the scale, or one that is not above 0.
    NoGroundPlaneError
        The ground is needed, and too few features lie on a plane below the cameras.

    Examples
    --------
    >>> log = groundmap.read_views("sparse/0")  # doctest: +SKIP
    >>> views = align(log, camera_height=1.65)  # doctest: +SKIP
    """
    given = {"scale": scale, "camera_height": camera_height, "scale_points": scale_points}
    names = [name for name, value in given.items() if value is not None]
    if len(names) > 1:
        raise InputError("scale", "one option that gives the scale", " and ".join(names))
    if level is None:
        level = isinstance(log, SparseMapLog) and not (
            log.sparse.metric and log.sparse.up is not None
        )
    ground = estimate_ground(log) if level or camera_height is not None else None
    if ground is None and (camera_height is not None):
        raise NoGroundPlaneError(
            "no plane below the cameras contains enough features to measure the height of the "
            "cameras above it: give the scale by --scale or --scale-points"
        )
    factor = 1.0
    if scale is not None:
        factor = as_number("scale", scale, "a number above 0", above=0.0)
    elif scale_points is not None:
        factor = _scale_between(log, scale_points)
    elif camera_height is not None:
        assert ground is not None
        height = as_number("camera_height", camera_height, "a number above 0 [m]", above=0.0)
        factor = height / ground.camera_height
    rotation = np.eye(3)
    if level and ground is not None:
        rotation = _level_rotation(log, ground.up)
    return AlignedViews(log, Similarity(scale=factor, rotation=rotation), ground)


def _level_rotation(log: ViewLog, up: Floats) -> Floats:
    """Return the rotation to axes with z up, and x along the optical axis of the first view."""
    first = next(iter(log))
    axis = first.T_map_camera[:3, 2]
    forward = axis - (axis @ up) * up
    if np.linalg.norm(forward) < 1e-3:
        axis = first.T_map_camera[:3, 1]
        forward = axis - (axis @ up) * up
    forward /= np.linalg.norm(forward)
    return np.stack([forward, np.cross(up, forward), up])


def _scale_between(log: ViewLog, points: ScalePoints) -> float:
    if not isinstance(log, SparseMapLog):
        raise InputError("scale_points", "a sparse map, which has landmarks", f"{log.path}")
    distance = as_number("distance", points.distance, "a number above 0 [m]", above=0.0)
    ends = [_place(log.sparse, text) for text in (points.first, points.second)]
    apart = float(np.linalg.norm(ends[1] - ends[0]))
    if not apart > 0:
        raise InputError("scale_points", "two different places", f"{points.first} twice")
    return distance / apart


def _place(sparse: SparseMap, text: str) -> Floats:
    """Return a place of a sparse map: the landmark of an id, the camera of a name, or X,Y,Z."""
    if text in sparse.names:
        centre: Floats = sparse.centres[sparse.names.index(text)]
        return centre
    words = text.split(",")
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    if len(numbers) == 3 and all(map(math.isfinite, numbers)):
        return np.array(numbers)
    assert sparse.ids is not None
    if len(numbers) == 1 and numbers[0].is_integer() and abs(numbers[0]) < 2**63:
        rows = np.flatnonzero(sparse.ids == int(numbers[0]))
        if len(rows):
            landmark: Floats = sparse.landmarks[rows[0]]
            return landmark
    expected = "the id of a landmark, the name of a view, or X,Y,Z in the world of the file"
    raise InputError("scale_points", expected, repr(text))

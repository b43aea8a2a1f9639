"""The poses of a drive, from the features of its views."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from groundmap.arrays import Floats
from groundmap.errors import InputError, RegistrationError
from groundmap.registration.pose_graph import Edge, solve_pose_graph
from groundmap.registration.register import Registration, register
from groundmap.registration.settings import RegistrationSettings
from groundmap.view.frames import invert
from groundmap.view.view import View

BACK = 5  # earlier views that a view is registered to until one agrees
DRIFT = 0.02  # of the path, by which a place may be off when it is seen again
LOOP_APART = 20  # views between two visits
LOOP_NEAR = 3.0  # [m]
LOOP_TURN = 0.5  # [rad]
GIVEN_SIGMA = (0.1, 0.01)  # [m, rad], of a given relative pose where registration is refused


class Trajectory(NamedTuple):
    """Poses of the views of a drive, and how they were found."""

    poses: Floats  #: shape (n, 4, 4) [m, map], `View.T_map_base`
    edges: list[Edge]  #: relative poses that registration measured
    closures: list[tuple[int, int]]  #: views of places that were seen again
    refused: dict[int, str]  #: views without a registration to an earlier one, with the reason


def estimate_poses(
    views: Iterable[View], *, mode: Literal["estimate", "refine"] = "estimate", **settings: Any
) -> Trajectory:
    """Return the poses of the views of a drive, by registration of each to earlier ones.

    A view is registered to the one before or, where that is refused, to one of four earlier ones.
    When a place is seen again, both visits are registered, and the poses then agree best with all
    these relative poses (`solve_pose_graph`). The first view keeps its pose.

    Parameters
    ----------
    views : iterable of View
        Consecutive views of a drive; all are held in memory.
    mode : {"estimate", "refine"}
        "estimate" ignores the poses of the views and assumes a steady motion as a guess. "refine"
        starts from their poses, and keeps a given relative pose where registration is refused.
    **settings
        Fields of `groundmap.RegistrationSettings`.

    Returns
    -------
    Trajectory

    Raises
    ------
    RegistrationError
        In mode "estimate": a view agrees with none of the views before.
    InputError
        `mode` is another one.
    SettingsError
        A setting is unknown or out of range.

    Examples
    --------
    >>> estimate_poses([]).poses.shape
    (0, 4, 4)
    """
    if mode not in ("estimate", "refine"):
        raise InputError("mode", "'estimate' or 'refine'", repr(mode)[:60])
    options = RegistrationSettings(**settings)
    drive = _Drive(list(views), mode == "refine", options)
    for number in range(1, len(drive.views)):
        drive.add(number)
    return drive.solve()


def with_poses(views: Iterable[View], poses: Floats) -> Iterator[View]:
    """Yield views with other poses.

    Parameters
    ----------
    views : iterable of View
    poses : ndarray, shape (n, 4, 4) [m, map]
    """
    for view, pose in zip(views, poses, strict=True):
        yield replace(view, T_map_base=pose)


class _Drive:
    """The state of an estimation."""

    def __init__(self, views: Sequence[View], refines: bool, options: RegistrationSettings) -> None:
        self.views, self.refines = views, refines
        self.options = options.model_dump()
        self.poses: list[Floats] = [_rigid(views[0].T_map_base)] if views else []
        self.path = [0.0]
        self.edges: list[Edge] = []
        self.closures: list[tuple[int, int]] = []
        self.refused: dict[int, str] = {}

    def add(self, number: int) -> None:
        """Add a view: measure its pose relative to earlier ones."""
        guess = self._guess(number)
        edge = self._measure(number, guess)
        if edge is not None:
            guess = _rigid(self.poses[edge.first] @ edge.T_first_second)
        self.poses.append(guess)
        step = float(np.linalg.norm(guess[:3, 3] - self.poses[-2][:3, 3]))
        self.path.append(self.path[-1] + step)
        self._close(number)

    def solve(self) -> Trajectory:
        """Return the poses that agree best with all edges."""
        poses = np.array(self.poses).reshape(-1, 4, 4)
        if len(poses) > 1:
            poses = solve_pose_graph(poses, self.edges)
        return Trajectory(poses, self.edges, self.closures, self.refused)

    def _guess(self, number: int) -> Floats:
        if self.refines:
            step = invert(self.views[number - 1].T_map_base) @ self.views[number].T_map_base
        elif number > 1:
            step = invert(self.poses[-2]) @ self.poses[-1]
        else:
            step = np.eye(4)
        return _rigid(self.poses[-1] @ step)

    def _measure(self, number: int, guess: Floats) -> Edge | None:
        """Return the measured pose relative to the last view, or else to one before it."""
        reasons = []
        for first in range(number - 1, max(number - 1 - BACK, -1), -1):
            relative = invert(self.poses[first]) @ guess
            try:
                found = self._register(first, number, relative, {})
            except RegistrationError as error:
                reasons.append(error)
                continue
            return self._keep(first, number, found)
        if not self.refines:
            raise RegistrationError(
                reasons[0].reason,
                f"the pose of view {number} cannot be estimated: relative to view {number - 1}, "
                f"{reasons[0]}",
            )
        self.refused[number] = str(reasons[0])
        sigma = np.repeat(GIVEN_SIGMA, 3)
        relative = invert(self.poses[number - 1]) @ guess
        self.edges.append(Edge(number - 1, number, relative, np.diag(sigma**2)))
        return None

    def _try(self, first: int, second: int, bounds: dict[str, float]) -> bool:
        """Measure a relative pose that is roughly known, if it is not refused."""
        relative = invert(self.poses[first]) @ self.poses[second]
        try:
            found = self._register(first, second, relative, bounds)
        except RegistrationError:
            return False
        self._keep(first, second, found)
        return True

    def _close(self, number: int) -> None:
        """Register a view to the nearest earlier visit of its place."""
        if number <= LOOP_APART:
            return
        earlier = np.array(self.poses[: number - LOOP_APART])
        pose = self.poses[number]
        apart = np.linalg.norm(earlier[:, :3, 3] - pose[:3, 3], axis=1)
        aligned = np.einsum("nij,ij->n", earlier[:, :3, :3], pose[:3, :3])
        drift = DRIFT * (self.path[number] - np.array(self.path[: len(earlier)]))
        apart[(apart > LOOP_NEAR + drift) | (0.5 * (aligned - 1.0) < np.cos(LOOP_TURN))] = np.inf
        nearest = int(np.argmin(apart))
        if not np.isfinite(apart[nearest]):
            return
        reach = self.options["max_translation"] + float(drift[nearest])
        if self._try(nearest, number, {"max_translation": reach}):
            self.closures.append((nearest, number))

    def _register(
        self, first: int, second: int, guess: Floats, bounds: dict[str, float]
    ) -> Registration:
        settings = self.options | bounds
        return register(self.views[first], self.views[second], guess=guess, **settings)

    def _keep(self, first: int, second: int, found: Registration) -> Edge:
        edge = Edge(first, second, found.T_a_b, found.covariance)
        self.edges.append(edge)
        return edge


def _rigid(pose: Floats) -> Floats:
    """Return a product of poses without the rounding errors of its rotation."""
    rigid = pose.copy()
    rigid[:3, :3] = Rotation.from_matrix(pose[:3, :3]).as_matrix()
    return rigid

"""Pose graphs: the poses that agree best with relative poses between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import spsolve
from scipy.spatial.transform import Rotation

from groundmap.arrays import Floats, Ints
from groundmap.view.frames import invert

TOLERANCE = 1e-9  # [m, rad]
MOST_STEPS = 50
CAUCHY = 5.0  # standard deviations of an edge at which its weight is half
LEAST_VARIANCE = 1e-10  # [m², rad²]
UNKNOWNS = 6  # of a pose: translation [m], rotation vector [rad]


class Edge(NamedTuple):
    """The pose of one view relative to another, as measured."""

    first: int
    second: int
    T_first_second: Floats  #: shape (4, 4)
    covariance: Floats  #: shape (6, 6): translation [m], rotation vector [rad], in the second


def solve_pose_graph(poses: Floats, edges: Sequence[Edge]) -> Floats:
    """Return the poses that agree best with measured relative poses, by robust least squares.

    The first pose stays as it is. Edges that contradict the others count less (Cauchy's loss).

    Parameters
    ----------
    poses : ndarray, shape (n, 4, 4) [m, map]
        Rough poses to start from.
    edges : sequence of Edge
        They must connect all poses.

    Returns
    -------
    ndarray, shape (n, 4, 4) [m, map]

    Examples
    --------
    >>> step = np.eye(4)
    >>> step[0, 3] = 1.0
    >>> edges = [Edge(0, 1, step, 0.01 * np.eye(6))]
    >>> solve_pose_graph(np.stack([np.eye(4)] * 2), edges)[1, :3, 3].round(6)
    array([1., 0., 0.])
    """
    if len(poses) < 2 or not edges:
        return poses.copy()
    graph = _Graph(edges)
    for _ in range(MOST_STEPS):
        jacobian, deviations = graph.linearise(poses)
        squares = (deviations**2).sum(axis=1)
        weights = np.repeat(1.0 / (1.0 + squares / CAUCHY**2), UNKNOWNS)
        weighted = jacobian.multiply(weights[:, None]).tocsr()
        matrix = (weighted.T @ jacobian).tocsc()
        step = spsolve(matrix, -(weighted.T @ deviations.ravel())).reshape(-1, UNKNOWNS)
        poses = _move(poses, step)
        if np.abs(step).max() < TOLERANCE:
            break
    return poses


class _Graph:
    """Edges as arrays."""

    def __init__(self, edges: Sequence[Edge]) -> None:
        self.first: Ints = np.array([edge.first for edge in edges])
        self.second: Ints = np.array([edge.second for edge in edges])
        self.T_second_first = np.stack([invert(edge.T_first_second) for edge in edges])
        self.whitening = np.stack([_whitening(edge.covariance) for edge in edges])

    def linearise(self, poses: Floats) -> tuple[csr_matrix, Floats]:
        """Return the derivatives by small motions of all poses but the first, and deviations.

        Parameters
        ----------
        poses : ndarray, shape (n, 4, 4)

        Returns
        -------
        jacobian : csr_matrix, shape (6 m, 6 (n - 1))
        deviations : ndarray, shape (m, 6)
            Of each edge, in standard deviations.
        """
        apart = np.stack(
            [invert(poses[i]) @ poses[j] for i, j in zip(self.first, self.second, strict=True)]
        )
        error = self.T_second_first @ apart
        turned = Rotation.from_matrix(error[:, :3, :3]).as_rotvec()
        off = np.concatenate([error[:, :3, 3], turned], axis=1)
        deviations: Floats = np.einsum("nij,nj->ni", self.whitening, off)
        by_first = -self.whitening @ np.stack([_adjoint(invert(pose)) for pose in apart])
        blocks = np.concatenate([by_first, self.whitening])
        pose = np.concatenate([self.first, self.second]) - 1
        edge = np.tile(np.arange(len(apart)), 2)
        blocks, pose, edge = blocks[pose >= 0], pose[pose >= 0], edge[pose >= 0]
        inner = np.arange(UNKNOWNS)
        rows = np.broadcast_to(UNKNOWNS * edge[:, None, None] + inner[:, None], blocks.shape)
        columns = np.broadcast_to(UNKNOWNS * pose[:, None, None] + inner, blocks.shape)
        shape = UNKNOWNS * len(apart), UNKNOWNS * (len(poses) - 1)
        jacobian = csr_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=shape)
        return jacobian, deviations


def _move(poses: Floats, steps: Floats) -> Floats:
    """Return the poses after a small motion of each but the first, in its own frame."""
    change = np.tile(np.eye(4), (len(poses), 1, 1))
    change[1:, :3, :3] = Rotation.from_rotvec(steps[:, 3:]).as_matrix()
    change[1:, :3, 3] = steps[:, :3]
    moved = poses @ change
    # The product of rotations, without its rounding errors.
    moved[1:, :3, :3] = Rotation.from_matrix(moved[1:, :3, :3]).as_matrix()
    return moved


def _adjoint(transform: Floats) -> Floats:
    """Return the matrix that brings small motions into another frame, shape (6, 6)."""
    rotation = transform[:3, :3]
    x, y, z = transform[:3, 3]
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.block([[rotation, cross @ rotation], [np.zeros((3, 3)), rotation]])


def _whitening(covariance: Floats) -> Floats:
    """Return a matrix that scales deviations to standard deviations.

    A planar motion has directions without variance, which get a small one.
    """
    values, vectors = np.linalg.eigh(covariance)
    whitening: Floats = vectors.T / np.sqrt(np.maximum(values, LEAST_VARIANCE))[:, None]
    return whitening

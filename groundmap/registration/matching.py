"""The search for motions under which many features of two views agree."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from groundmap.arrays import Bools, Floats, Ints
from groundmap.registration.feature_set import Bins, FeatureSet, bins_of
from groundmap.registration.kernels.alignment import score_poses
from groundmap.registration.kernels.triangles import (
    find_candidates,
    match_triangles,
    poses_of_triangles,
)
from groundmap.registration.motion_model import MotionModel
from groundmap.registration.solving import Alignment, align

NEIGHBOURS = 24  # of a corner among the pool; compact triangles have fewer counterparts by chance
BATCH = 20  # triangles per round
SIDE_SIGMAS = 1.0  # covariances of matched pixels are mostly bounds
MOST_HYPOTHESES = 4000  # per round
SAMPLE = 120  # features that score a hypothesis
SCORE_GATE = 0.008  # [rad]
OVERSAMPLE = 6  # triangles are the best of so many times as many
CORNERS = 3
REFINED = 2  # hypotheses per round
PROMISING = 0.5  # share of the best score
COARSE_SHARE = 1.02  # motions slightly beyond the bound, before they are refined


class Bounds(NamedTuple):
    """The largest motion from A to B, where a guess has placed A."""

    translation: float  #: [m]
    rotation: float  #: [rad]

    @property
    def turn(self) -> float:
        """Largest change of a vector by the rotation, as a share of its length."""
        return float(2.0 * np.sin(min(self.rotation, np.pi) / 2.0))


class Search:
    """Search for motions from A to B by triangles whose sides agree.

    Parameters
    ----------
    a, b : FeatureSet
        `a` where the guess places it.
    bounds : Bounds
    model : MotionModel
    pool : int
        Number of the best features of A that triangles are made of; of B, half as many more.
    seed : int
        Seed of the choice of triangles.
    """

    def __init__(
        self,
        a: FeatureSet,
        b: FeatureSet,
        bounds: Bounds,
        model: MotionModel,
        *,
        pool: int,
        seed: int,
    ) -> None:
        self.a, self.b, self.bounds, self.model = a, b, bounds, model
        self.random = np.random.default_rng(seed)
        self.bins: Bins = bins_of(b)
        self.chosen = np.argsort(a.spread, kind="stable")[:pool]
        self.pool = a.select(self.chosen)
        best = np.argsort(b.spread, kind="stable")[: pool * 3 // 2]
        self.targets_chosen = best[np.argsort(b.xyz[best, 0], kind="stable")]
        self.targets = b.select(self.targets_chosen)
        self.history: list[tuple[Ints, Ints, Ints]] = []
        self.spread = self.targets.spread
        sample = a.select(self.random.permutation(len(a.xyz))[:SAMPLE])
        self.sample = sample, sample.inverse_depth_noise
        self.noise = b.inverse_depth_noise
        reach = bounds.translation + bounds.turn * np.linalg.norm(self.pool.xyz, axis=1)
        self.candidates = find_candidates(
            self.pool.xyz,
            self.targets.xyz,
            2.0 * self.spread,
            self.pool.labels,
            self.targets.labels,
            reach + 2.0 * self.pool.spread,
        )

    def round(self, known: list[Alignment], *, among: Alignment | None = None) -> list[Alignment]:
        """Return new motions from one more round, each refined.

        Parameters
        ----------
        known : list of Alignment
            Motions that earlier rounds found.
        among : Alignment, optional
            Use only features that this motion matches, which a similar motion would match, too.
        """
        rows = np.arange(len(self.chosen))
        if among is not None:
            rows = np.flatnonzero(among.partner[self.chosen] >= 0)
        if len(rows) < CORNERS:
            return []
        corners, poses = self._hypotheses(self._triangles(rows))
        if not len(poses):
            return []
        scores = self._scores(poses)
        least = max((self._scores(best.pose[None])[0] for best in known), default=0)
        found: list[Alignment] = []
        tried = 0
        for row in np.argsort(-scores, kind="stable"):
            if tried == REFINED or scores[row] < PROMISING * least:
                break
            if any(_contains(other, corners[row]) for other in known + found):
                continue
            tried += 1
            alignment = align(
                poses[row], self.a, self.b, self.bins, directions=self.model.directions
            )
            if alignment is not None and self._within(alignment.pose[None], 1.0)[0]:
                found.append(alignment)
        return found

    def triangles_of(self, alignment: Alignment) -> int:
        """Return how many triangles of all rounds belong to a motion."""
        return sum(
            len(np.unique(numbers[(alignment.partner[rows] == partners).all(axis=1)]))
            for numbers, rows, partners in self.history
        )

    def _scores(self, poses: Floats) -> Ints:
        """Return how many features of the sample meet a feature of B under each motion."""
        scores = np.zeros(len(poses), dtype=np.int64)
        sample, noise = self.sample
        score_poses(
            poses,
            sample.xyz,
            noise,
            sample.labels,
            self.b.bearings,
            self.noise,
            self.b.labels,
            *self.bins,
            SCORE_GATE,
            scores,
        )
        return scores

    def _triangles(self, rows: Ints) -> Ints:
        """Return triangles of neighbouring features that are large against their noise."""
        count = min(NEIGHBOURS + 1, len(rows))
        near = rows[cKDTree(self.pool.xyz[rows]).query(self.pool.xyz[rows], k=count)[1]]
        corner = self.random.integers(0, len(rows), OVERSAMPLE * BATCH)
        second, third = self.random.integers(1, count, (2, OVERSAMPLE * BATCH))
        triangles = np.stack([rows[corner], near[corner, second], near[corner, third]], axis=1)
        triangles = triangles[second != third]
        xyz = self.pool.xyz[triangles]
        sides = np.linalg.norm(xyz - np.roll(xyz, 1, axis=1), axis=2).max(axis=1)
        areas = np.linalg.norm(np.cross(xyz[:, 1] - xyz[:, 0], xyz[:, 2] - xyz[:, 0]), axis=1)
        noise = self.pool.spread[triangles].max(axis=1)
        quality = areas / np.maximum(sides, 1e-9) / (noise + self.bounds.turn * sides) ** 1.5
        chosen: Ints = triangles[np.argsort(-quality, kind="stable")[:BATCH]]
        return chosen

    def _hypotheses(self, triangles: Ints) -> tuple[Ints, Floats]:
        """Return the rows of A and B of matched triangles, shape (h, 2, 3), and their motions."""
        matched = np.empty((MOST_HYPOTHESES, 4), dtype=np.int64)
        count = match_triangles(
            triangles,
            self.pool.xyz,
            self.pool.covariance,
            self.targets.xyz,
            self.targets.covariance,
            self.spread,
            self.pool.labels,
            self.targets.labels,
            *self.candidates,
            SIDE_SIGMAS,
            self.bounds.turn,
            matched,
        )
        matched = matched[:count]
        poses = np.empty((count, 3, 4))
        poses_of_triangles(triangles, matched, self.pool.xyz, self.targets.xyz, poses)
        rows = self.chosen[triangles[matched[:, 0]]]
        partners = self.targets_chosen[matched[:, 1:]]
        self.history.append((matched[:, 0], rows, partners))
        poses = self.model.project(poses)
        inside = self._within(poses, COARSE_SHARE)
        return np.stack([rows, partners], axis=1)[inside], poses[inside]

    def _within(self, poses: Floats, share: float) -> Bools:
        cosine = 0.5 * (np.trace(poses[:, :, :3], axis1=1, axis2=2) - 1.0)
        turned = np.arccos(np.clip(cosine, -1.0, 1.0)) <= share * self.bounds.rotation
        shift = np.linalg.norm(poses[:, :, 3], axis=1)
        inside: Bools = turned & (shift <= share * self.bounds.translation + (share - 1.0))
        return inside


def _contains(alignment: Alignment, corners: Ints) -> bool:
    """Return whether a motion matches the corners of two triangles, shape (2, 3)."""
    return bool((alignment.partner[corners[0]] == corners[1]).all())

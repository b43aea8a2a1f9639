"""A small known scene, for writers of the formats of SLAM and SfM systems."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from groundmap.arrays import Floats

Files = dict[str, bytes]

FOCAL, WIDTH, HEIGHT = 500.0, 1280, 720


@dataclass(frozen=True)
class Scene:
    """A drive of five views past landmarks on the ground and on two walls."""

    rotations: Floats  #: shape (n, 3, 3), camera to world
    centres: Floats  #: shape (n, 3) [world]
    landmarks: Floats  #: shape (m, 3) [world]
    pairs: list[tuple[int, int]]  #: (view, landmark), sorted
    ids: list[int] = field(default_factory=list)  #: of the landmarks, with gaps

    def in_camera(self, view: int, landmark: int) -> Floats:
        """Return a landmark in the frame of a camera."""
        offset = self.landmarks[landmark] - self.centres[view]
        moved: Floats = offset @ self.rotations[view]
        return moved

    def pixel(self, view: int, landmark: int) -> tuple[float, float]:
        """Return the column and row of a landmark in a view."""
        x, y, z = self.in_camera(view, landmark)
        return FOCAL * x / z + WIDTH / 2, FOCAL * y / z + HEIGHT / 2

    def seen_by(self, view: int) -> list[int]:
        """Return the landmarks that a view saw."""
        return [landmark for number, landmark in self.pairs if number == view]

    def views_of(self, landmark: int) -> list[int]:
        """Return the views that saw a landmark."""
        return [view for view, number in self.pairs if number == landmark]

    def translation(self, view: int) -> Floats:
        """Return the translation of world to camera."""
        moved: Floats = -self.rotations[view].T @ self.centres[view]
        return moved

    def quaternion(self, view: int, *, inverse: bool) -> Floats:
        """Return x y z w of camera to world, or of its inverse."""
        rotation = Rotation.from_matrix(self.rotations[view])
        found: Floats = (rotation.inv() if inverse else rotation).as_quat()
        return found


def make_scene(*, views: int = 5, landmarks: int = 60, tilt: float = 0.0) -> Scene:
    """Return a scene in an optical world (y down), the ground 1.5 below the cameras.

    Parameters
    ----------
    views, landmarks : int
    tilt : float [rad]
        Of the world about an oblique axis.
    """
    rng = np.random.default_rng(4)
    turn = Rotation.from_rotvec(tilt * np.array([0.8, 0.0, 0.6])).as_matrix()
    yaw = 0.02 * np.arange(views)
    rotations = Rotation.from_rotvec(np.outer(yaw, [0.0, 1.0, 0.0])).as_matrix()
    centres = np.column_stack([0.05 * np.arange(views), np.zeros(views), 0.8 * np.arange(views)])
    third = landmarks // 3
    ground = np.column_stack(
        [rng.uniform(-2, 2, third), np.full(third, 1.5), rng.uniform(3, 14, third)]
    )
    walls = [
        np.column_stack(
            [np.full(third, side), rng.uniform(-0.5, 1.4, third), rng.uniform(3, 14, third)]
        )
        for side in (-3.0, 3.0)
    ]
    points = np.concatenate([ground, *walls])
    scene = Scene(turn @ rotations, centres @ turn.T, points @ turn.T, [])
    pairs = []
    for view in range(views):
        for landmark in range(len(points)):
            x, y, z = scene.in_camera(view, landmark)
            if z > 1.0 and abs(x) < z and abs(y) < z * 0.7:
                pairs.append((view, landmark))
    ids = [7 + 3 * landmark for landmark in range(len(points))]
    return Scene(scene.rotations, scene.centres, scene.landmarks, pairs, ids)

"""Transforms between the frames of a robot, over time, as ROS publishes them."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from groundmap.arrays import Floats
from groundmap.view.frames import invert

MOST_DEPTH = 100  # frames of a chain
TOLERANCE = 0.1  # [s] before the first and after the last transform
LARGEST_GAP = 1.0  # [s] between two transforms that are interpolated
WORLDS = ("map", "odom", "world", "global")


class TransformTree:
    """Frames and their parents; a frame has one parent, fixed or moving."""

    def __init__(self) -> None:
        self._fixed: dict[str, tuple[str, Floats]] = {}
        self._moving: dict[str, tuple[str, list[float], list[Floats]]] = {}

    def add(self, parent: str, child: str, time: float | None, transform: Floats) -> None:
        """Add the pose of a frame in its parent.

        Parameters
        ----------
        parent, child : str
        time : float or None [s]
            None for a pose that does not change.
        transform : ndarray, shape (4, 4)
            ``T_parent_child``.
        """
        if time is None:
            self._fixed[child] = (parent, transform)
            return
        known = self._moving.setdefault(child, (parent, [], []))
        if known[0] != parent:  # several estimates of one frame: the first is used
            return
        place = bisect_left(known[1], time)
        if place < len(known[1]) and known[1][place] == time:
            known[2][place] = transform
        else:
            known[1].insert(place, time)
            known[2].insert(place, transform)

    def has_parent(self, frame: str) -> bool:
        """Return whether a frame has a parent."""
        return frame in self._fixed or frame in self._moving

    def chain(self, frame: str) -> list[str]:
        """Return the frames from one to its root, both included."""
        frames = [frame]
        while len(frames) < MOST_DEPTH:
            parent = self._parent(frames[-1])
            if parent is None or parent in frames:
                break
            frames.append(parent)
        return frames

    def moves(self, frame: str) -> bool:
        """Return whether a frame moves in its root."""
        return any(name in self._moving for name in self.chain(frame))

    def _parent(self, frame: str) -> str | None:
        entry = self._moving.get(frame) or self._fixed.get(frame)
        return None if entry is None else entry[0]

    def pose(self, frame: str, time: float) -> Floats | None:
        """Return the pose of a frame in its root; None at a time for which it is not known.

        Parameters
        ----------
        frame : str
        time : float [s]
        """
        pose = np.eye(4)
        for name in self.chain(frame)[:-1]:
            step = self._step(name, time)
            if step is None:
                return None
            pose = step @ pose
        return pose

    def within(self, frame: str, ancestor: str, time: float) -> Floats | None:
        """Return the pose of a frame in one of its ancestors; None if it is not known.

        Parameters
        ----------
        frame, ancestor : str
        time : float [s]
        """
        below, above = self.pose(frame, time), self.pose(ancestor, time)
        return None if below is None or above is None else invert(above) @ below

    def _step(self, frame: str, time: float) -> Floats | None:
        if frame not in self._moving:
            return self._fixed[frame][1]
        _, times, transforms = self._moving[frame]
        after = bisect_left(times, time)
        if after < len(times) and times[after] == time:
            return transforms[after]
        if after in (0, len(times)):
            nearest = min(after, len(times) - 1)
            return transforms[nearest] if abs(times[nearest] - time) <= TOLERANCE else None
        if times[after] - times[after - 1] > LARGEST_GAP:
            return None
        return _between(times[after - 1 : after + 1], transforms[after - 1 : after + 1], time)

    def roots(self) -> Iterator[str]:
        """Yield the frames at the ends of chains."""
        children = set(self._fixed) | set(self._moving)
        yield from sorted({self.chain(child)[-1] for child in children})


def _between(times: list[float], transforms: list[Floats], time: float) -> Floats:
    share = (time - times[0]) / (times[1] - times[0])
    rotations = Rotation.from_matrix(np.array([pose[:3, :3] for pose in transforms]))
    pose = np.eye(4)
    pose[:3, :3] = Slerp([0.0, 1.0], rotations)(share).as_matrix()
    pose[:3, 3] = (1.0 - share) * transforms[0][:3, 3] + share * transforms[1][:3, 3]
    return pose

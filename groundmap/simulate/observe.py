"""Observation of a world: the views of a drive, as a stereo sensor would log them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Bools, Floats, Ints
from groundmap.simulate.drive import Drive
from groundmap.simulate.landmarks import Landmarks, LandmarkSet, present_at
from groundmap.simulate.matching import break_segments, match
from groundmap.simulate.occlusion import in_sight
from groundmap.simulate.sensor import SensorSettings
from groundmap.simulate.world import World
from groundmap.view.view import View

PLACES = 9  # points along a segment that are tested to find its visible piece


class _Seen(NamedTuple):
    """Landmarks of one kind, or pieces of them, that are in sight."""

    pixels: Floats  # (n, ends, 3) [px], true
    ids: Ints  # (n,), rows of the landmarks


def observe(
    world: World, landmarks: Landmarks, moves: Drive, settings: SensorSettings, *, seed: int
) -> Iterator[View]:
    """Yield the views of a drive, one per pose, with the logged poses.

    Parameters
    ----------
    world : World
    landmarks : Landmarks
        From `groundmap.simulate.landmarks.sample_landmarks`.
    moves : Drive
    settings : SensorSettings
    seed : int
        Each view has its own random numbers, so that views do not depend on each other.

    Notes
    -----
    Landmark ids are the rows of the landmarks, points first.
    """
    for number, (pose, logged, time) in enumerate(zip(*moves, strict=True)):
        rng = np.random.default_rng((seed, number))
        scene = _Scene(world, pose, time, settings)
        points = _some_of(scene.points(landmarks.points), settings.max_points, rng)
        matched, kept = match(points.pixels, scene.periods(points, landmarks.points), settings, rng)
        strokes = _some_of(scene.segments(landmarks.segments), settings.max_segments, rng)
        lines, lines_kept = match(
            strokes.pixels, scene.periods(strokes, landmarks.segments), settings, rng
        )
        pieces, row = break_segments(lines[lines_kept], settings, rng)
        yield View.from_pixels(
            logged,
            settings.rig,
            points_px=matched[kept, 0],
            point_ids=points.ids[kept],
            segments_px=pieces,
            segment_ids=strokes.ids[lines_kept][row] + len(landmarks.points),
            timestamp=time,
        )


class _Scene:
    """The world from one pose at one time."""

    def __init__(self, world: World, pose: Floats, time: float, settings: SensorSettings) -> None:
        self.world, self.pose, self.time, self.settings = world, pose, time, settings
        self.now = world.at(time)
        self.eye = (pose @ settings.rig.T_base_camera)[:3, 3]

    def points(self, marks: LandmarkSet) -> _Seen:
        """Return the point landmarks in sight."""
        xyz, present = present_at(marks, self.world, self.time)
        pixels, seen = self._look(xyz, present)
        ids = np.flatnonzero(seen)
        return _Seen(pixels[ids, None], ids)

    def segments(self, marks: LandmarkSet) -> _Seen:
        """Return the segment landmarks in sight: the longest visible piece of each."""
        xyz, present = present_at(marks, self.world, self.time)
        share = np.linspace(0.0, 1.0, PLACES)[:, None]
        places = xyz[:, :1] * (1.0 - share) + xyz[:, 1:] * share
        _, seen = self._look(places.reshape(-1, 3), np.repeat(present, PLACES))
        start, length = _longest_runs(seen.reshape(-1, PLACES))
        ids = np.flatnonzero(length > 1)
        ends = np.stack([start[ids], start[ids] + length[ids] - 1], axis=1)
        visible = places[ids[:, None], ends]
        pixels, _ = self.settings.project(self.pose, self._lift(visible.reshape(-1, 3)))
        return _Seen(pixels.reshape(-1, 2, 3), ids)

    def periods(self, seen: _Seen, marks: LandmarkSet) -> Floats:
        """Return the periods of repeated patterns in the images, (n,) [px]; 0 for no pattern.

        The patterns are assumed to face the camera.

        Parameters
        ----------
        seen : _Seen
        marks : LandmarkSet
        """
        repeats = np.array([0.0, *(solid.repeat for solid in self.world.solids)])
        disparity_px = (seen.pixels[..., 0] - seen.pixels[..., 1]).mean(axis=1)
        periods: Floats = repeats[marks.owner[seen.ids] + 1] * disparity_px / self.settings.baseline
        return periods

    def _look(self, places: Floats, present: Bools) -> tuple[Floats, Bools]:
        """Return the pixels of places, and which of them are visible in both images."""
        lifted = self._lift(places)
        pixels, seen = self.settings.project(self.pose, lifted)
        rows = np.flatnonzero(seen & present)
        seen[:] = False
        eye, relief = self.eye.copy(), self.world.relief
        if relief is not None:
            # Landmarks in a hole are behind its mouth, which `in_sight` checks.
            sunk = np.maximum(-places[rows, 2:], 0.0) * (0.0, 0.0, 1.0)
            rows = rows[relief.in_sight(eye, lifted[rows] + sunk)]
            eye[2] -= relief.height(eye[:2])
        seen[rows] = in_sight(self.now, eye, places[rows])
        return pixels, seen

    def _lift(self, places: Floats) -> Floats:
        """Raise places over flat ground, shape (n, 3) [m, map], to the relief of the world."""
        return places if self.world.relief is None else self.world.relief.lift(places)


def _some_of(seen: _Seen, most: int, rng: np.random.Generator) -> _Seen:
    if len(seen.ids) <= most:
        return seen
    rows = np.sort(rng.permutation(len(seen.ids))[:most])
    return _Seen(seen.pixels[rows], seen.ids[rows])


def _longest_runs(seen: Bools) -> tuple[Ints, Ints]:
    """Return start and length of the longest run of True in each row; length 0 if none."""
    run = np.zeros(len(seen), dtype=np.int64)
    best, start = np.zeros_like(run), np.zeros_like(run)
    for place in range(seen.shape[1]):
        run = np.where(seen[:, place], run + 1, 0)
        longer = run > best
        best = np.where(longer, run, best)
        start = np.where(longer, place - run + 1, start)
    return start, best

"""The driven track around a view: the shape of the ground that the poses of a drive reveal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats
from groundmap.view.frames import invert
from groundmap.view.ground_strip import GroundStrip
from groundmap.view.stereo_rig import StereoRig

SPACING = 0.25  # [m], least distance of the places that are used
LONGEST_STEP = 10.0  # [m] between two views; beyond, the ground between them is unknown
STEEPEST = 0.4  # rise per distance; a steeper step is a jump of the poses
UNSURE_RISE = 0.1  # [m], error of the heights of two poses
SMOOTHING = 1.0  # [m], standard deviation of the weights along the track
PRIOR = 0.4  # [m²], weight of the attitude of the base against the slope of the poses
UNSURE_LENGTH = 0.3  # [m]; of a track that is not longer, poses show no slope
SIDEWAYS = 0.8  # cosine; where the camera looks elsewhere, it does not show where the drive goes


class Pose(NamedTuple):
    """Where a view was taken."""

    T_map_base: Floats  #: shape (4, 4) [m, map]
    rig: StereoRig


class Track(NamedTuple):
    """The driven track around a view, as a strip in a frame at the camera of the view."""

    strip: GroundStrip  #: [m, level], through the reference points of the poses
    station: float  #: [m], of the view on the strip
    before: float  #: [m], how far it is driven before the view
    beyond: float  #: [m], and after it
    undriven: float  #: [m], length of the strip after the driven part

    @property
    def length(self) -> float:
        """Length that is driven [m]."""
        return self.before + self.beyond

    def raised(self, a: float, b: float, c: float) -> GroundStrip:
        """Return the strip raised by a station + b offset + c.

        Parameters
        ----------
        a, b : float
            Rise per distance after the view, and to the left.
        c : float [m]
        """
        strip = self.strip
        at = strip.locate(strip.places).station - self.station
        along = np.diff(strip.places, axis=0)
        along = np.concatenate([along, along[-1:]])
        along /= np.linalg.norm(along, axis=1)[:, None]
        normals = strip.normals - a * along - b * np.cross(strip.normals, along)
        return GroundStrip(
            places=strip.places + (a * at + c)[:, None] * strip.normals,
            normals=normals / np.linalg.norm(normals, axis=1)[:, None],
        )


def level_axes(rig: StereoRig) -> Floats:
    """Return axes with up of the base and forward of the camera, rows forward, left and up."""
    up = rig.up
    axis = rig.T_base_camera[:3, 2]
    forward = axis - (axis @ up) * up
    forward /= np.linalg.norm(forward)
    return np.stack([forward, np.cross(up, forward), up])


def driven_track(poses: Sequence[Pose], number: int, *, reach: float, below_camera: float) -> Track:
    """Return the track through poses, as far as it is connected and within reach.

    Parameters
    ----------
    poses : sequence of Pose
        Of consecutive views of a drive.
    number : int
        Index of the pose that the frame belongs to: origin at its left camera, axes forward, left
        and up, level with its base.
    reach : float [m]
        Length of the track before and after that pose.
    below_camera : float [m]
        The track runs this far below the cameras.
    """
    here = poses[number]
    rows = _connected(poses, number, reach)
    axes = level_axes(here.rig)
    T_level_map = np.eye(4)
    T_level_map[:3, :3] = axes
    T_level_map[:3, 3] = -axes @ here.rig.T_base_camera[:3, 3]
    T_level_map = T_level_map @ invert(here.T_map_base)
    bases = [T_level_map @ poses[row].T_map_base for row in rows]
    rigs = [poses[row].rig for row in rows]
    ups = np.array([base[:3, :3] @ rig.up for base, rig in zip(bases, rigs, strict=True)])
    cameras = np.array([base @ rig.T_base_camera for base, rig in zip(bases, rigs, strict=True)])
    return _track(
        cameras[:, :3, 3] - below_camera * ups, ups, cameras[:, :3, 2], rows.index(number), reach
    )


def _connected(poses: Sequence[Pose], number: int, reach: float) -> list[int]:
    """Return the rows around `number` that a drive connects, `SPACING` apart, up to `reach`."""
    rows = [number]
    for way in (range(number - 1, -1, -1), range(number + 1, len(poses))):
        last, length = poses[number].T_map_base[:3, 3], 0.0
        for row in way:
            place = poses[row].T_map_base[:3, 3]
            x, y, z = (place - last).tolist()
            distance = math.hypot(x, y)
            if distance > LONGEST_STEP or abs(z) > STEEPEST * distance + UNSURE_RISE:
                break
            if distance < SPACING:
                continue
            length += distance
            rows.append(row)
            last = place
            if length > reach:
                break
    return sorted(rows)


def _track(places: Floats, ups: Floats, looks: Floats, here: int, reach: float) -> Track:
    steps = np.hypot(*np.diff(places[:, :2], axis=0).T)
    stations = np.concatenate([[0.0], np.cumsum(steps)])
    stations -= stations[here]
    moves = looks if len(places) == 1 else np.gradient(places, axis=0)
    turns = np.hypot(moves[:, 0], moves[:, 1]) < 0.5 * SPACING  # the drive turns back here
    moves = np.where(turns[:, None], looks, moves)
    ups = _without_mounting(ups, looks, stations, places, _level_moves(moves, ups))
    smoothed, slopes = _smoothed(stations, places, _level_moves(moves, ups))
    normals = _normals(stations, ups, slopes)
    first = smoothed[0] - reach * slopes[0]
    onward = reach * _onward(slopes[-1], looks[-1])
    last, undriven = smoothed[-1] + onward, float(np.linalg.norm(onward))
    strip = GroundStrip(
        places=np.concatenate([first[None], smoothed, last[None]]),
        normals=np.concatenate([normals[:1], normals, normals[-1:]]),
    ).simplified()
    station = float(strip.locate(smoothed[here]).station)
    return Track(strip, station, -float(stations[0]), float(stations[-1]), undriven)


def _level_moves(moves: Floats, ups: Floats) -> Floats:
    """Return horizontal unit vectors of motion, shape (k, 3), raised to be level with the base."""
    flat = moves[:, :2] / np.maximum(np.hypot(moves[:, 0], moves[:, 1]), 1e-9)[:, None]
    return np.column_stack([flat, -np.einsum("ni,ni->n", flat, ups[:, :2]) / ups[:, 2]])


def _without_mounting(
    ups: Floats, looks: Floats, stations: Floats, places: Floats, level: Floats
) -> Floats:
    """Return upward unit vectors that are perpendicular to the track on average.

    A bare camera may be mounted with a pitch, which is that of its forward axis over the track.
    """
    length = stations[-1] - stations[0]
    turned = np.trapezoid(level[:, 2], stations)
    slope = (places[-1, 2] - places[0, 2] - turned) / (length + UNSURE_LENGTH)
    forward = looks - np.einsum("ni,ni->n", looks, ups)[:, None] * ups
    forward /= np.linalg.norm(forward, axis=1)[:, None]
    tilted = ups - slope * forward
    upright: Floats = tilted / np.linalg.norm(tilted, axis=1)[:, None]
    return upright


def _smoothed(stations: Floats, places: Floats, level: Floats) -> tuple[Floats, Floats]:
    """Return the places of lines that are fitted around each station, and their slopes.

    Shapes (k, 3); horizontally, slopes have length 1. Where few places are around, a line is level
    with the base.
    """
    apart = stations[None] - stations[:, None]
    weights = np.exp(-0.5 * (apart / SMOOTHING) ** 2)
    total = weights.sum(axis=1)
    centre = (weights * apart).sum(axis=1) / total
    apart = apart - centre[:, None]
    mean = weights @ places / total[:, None]
    moment = np.einsum("kn,kni->ki", weights * apart, places[None] - mean[:, None])
    spread = (weights * apart**2).sum(axis=1)
    slopes = (moment + PRIOR * level) / (spread + PRIOR)[:, None]
    smoothed = mean - slopes * centre[:, None]
    length = np.hypot(slopes[:, 0], slopes[:, 1])
    folded = length < 0.5  # the drive turns back here
    slopes[folded], length[folded] = level[folded], 1.0
    smoothed[folded] = places[folded]
    return smoothed, slopes / length[:, None]


def _normals(stations: Floats, ups: Floats, slopes: Floats) -> Floats:
    """Return unit vectors across the track, with the roll of the base, averaged along it."""
    along = slopes / np.linalg.norm(slopes, axis=1)[:, None]
    across = ups - np.einsum("ni,ni->n", ups, along)[:, None] * along
    weights = np.exp(-0.5 * ((stations[None] - stations[:, None]) / SMOOTHING) ** 2)
    across = weights @ across
    across -= np.einsum("ni,ni->n", across, along)[:, None] * along
    normals: Floats = across / np.linalg.norm(across, axis=1)[:, None]
    return normals


def _onward(slope: Floats, look: Floats) -> Floats:
    """Return the direction of the track after its last pose: there, the drive goes on ahead."""
    flat = look[:2] / np.hypot(look[0], look[1])
    if flat @ slope[:2] < SIDEWAYS:
        return slope
    return np.array([*flat, slope[2]])

"""A drive: the true poses of the views, and those of the log, with noise and drift."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import Field

from groundmap.arrays import Floats, as_floats, check_finite
from groundmap.errors import InputError
from groundmap.settings import Settings
from groundmap.simulate.world import FARTHEST

MOST_VIEWS = 100_000  # of a drive; more indicates a wrong unit


class DriveSettings(Settings):
    """The stops of a drive, and the errors of its logged poses."""

    stops: tuple[tuple[float, float, float], ...] = Field(
        min_length=1, description="x, y [m, map] and yaw [deg]; turns take the shorter way"
    )
    heights: tuple[float, ...] = Field(
        (), description="height of base_link above the ground at each stop; default: 0 [m]"
    )
    pitches: tuple[float, ...] = Field(
        (), description="downward pitch of base_link at each stop; default: 0 [deg]"
    )
    rolls: tuple[float, ...] = Field(
        (), description="roll of base_link to the right at each stop; default: 0 [deg]"
    )
    every: float = Field(1.0, gt=0, description="largest distance between views [m]")
    every_turn: float = Field(0.5, gt=0, description="largest turn between views [rad]")
    seconds_per_view: float = Field(1.0, gt=0, description="time between views [s]")
    position_noise: float = Field(
        0.0, ge=0, description="standard deviation of each pose's x and y [m]"
    )
    yaw_noise: float = Field(0.0, ge=0, description="standard deviation of each pose's yaw [rad]")
    drift: float = Field(0.0, description="relative error of the logged distances")
    yaw_drift: float = Field(0.0, description="error of the logged yaw per distance [rad/m]")


class Drive(NamedTuple):
    """Poses of ``base_link``, shape (n, 4, 4) [map]."""

    true: Floats
    logged: Floats  #: as logged, with noise and drift
    times: Floats  #: shape (n,) [s]


def drive(settings: DriveSettings, rng: np.random.Generator) -> Drive:
    """Return the poses of a drive from stop to stop, along straight lines at constant speed.

    Parameters
    ----------
    settings : DriveSettings
    rng : numpy Generator

    Raises
    ------
    InputError
        A stop that is not finite or farther than 1e8 m from the origin; another number of heights,
        pitches or rolls than of stops; more than 100,000 views.

    Examples
    --------
    >>> settings = DriveSettings(stops=((0, 0, 0), (3, 0, 0), (3, 0, 90)))
    >>> len(drive(settings, np.random.default_rng(1)).times)
    8
    """
    flat, tilted = np.split(_along(settings), [3], axis=1)
    logged = _add_drift(flat, settings)
    noise = rng.normal(size=flat.shape)
    logged += noise * (settings.position_noise, settings.position_noise, settings.yaw_noise)
    times = settings.seconds_per_view * np.arange(len(flat), dtype=np.float64)
    tilts = to_tilts(tilted)
    return Drive(to_transforms(flat) @ tilts, to_transforms(logged) @ tilts, times)


def to_tilts(tilted: Floats) -> Floats:
    """Return transforms, shape (n, 4, 4), of heights [m], downward pitches and rolls [rad]."""
    z, pitch, roll = tilted.T
    lifts, pitches, rolls = np.tile(np.eye(4), (3, len(z), 1, 1))
    lifts[:, 2, 3] = z
    pitches[:, 0, 0] = pitches[:, 2, 2] = np.cos(pitch)
    pitches[:, 0, 2], pitches[:, 2, 0] = np.sin(pitch), -np.sin(pitch)
    rolls[:, 1, 1] = rolls[:, 2, 2] = np.cos(roll)
    rolls[:, 1, 2], rolls[:, 2, 1] = -np.sin(roll), np.sin(roll)
    transforms: Floats = lifts @ pitches @ rolls
    return transforms


def to_transforms(poses: npt.ArrayLike) -> Floats:
    """Return transforms, shape (n, 4, 4), of poses on the ground: x, y [m] and yaw [rad]."""
    rows = as_floats("poses", poses, (None, 3))
    check_finite("poses", rows)
    x, y, yaw = rows.T
    transforms = np.tile(np.eye(4), (len(x), 1, 1))
    transforms[:, 0, 0], transforms[:, 0, 1] = np.cos(yaw), -np.sin(yaw)
    transforms[:, 1, 0], transforms[:, 1, 1] = np.sin(yaw), np.cos(yaw)
    transforms[:, 0, 3], transforms[:, 1, 3] = x, y
    return transforms


def _along(settings: DriveSettings) -> Floats:
    """Return x, y [m], yaw [rad], z [m], pitch and roll [rad] of each view."""
    stops = as_floats("stops", settings.stops, (None, 3))
    check_finite("stops", stops)
    farthest = np.abs(stops[:, :2]).max()
    if farthest > FARTHEST:
        raise InputError("stops", f"places within {FARTHEST:g} m of the origin", f"{farthest:g} m")
    z, pitch, roll = (_at_stops(name, settings) for name in ("heights", "pitches", "rolls"))
    turned = np.unwrap(np.radians(np.column_stack([stops[:, 2], pitch, roll])), axis=0)
    stops = np.column_stack([stops[:, :2], turned[:, 0], z, turned[:, 1:]])
    moves = np.diff(stops, axis=0)
    with np.errstate(over="ignore"):  # too long drives are refused below
        lengths = np.hypot(np.hypot(moves[:, 0], moves[:, 1]), moves[:, 3]) / settings.every
        turns = np.abs(moves[:, [2, 4, 5]]).max(axis=1) / settings.every_turn
    steps = np.maximum(np.ceil(np.maximum(lengths, turns)), 1.0)
    if not steps.sum() <= MOST_VIEWS:
        raise InputError(
            "stops",
            f"a drive of at most {MOST_VIEWS:g} views",
            f"{steps.sum():.3g}",
            hint="Give closer stops, or larger values of every [m] and every_turn [rad].",
        )
    counts = steps.astype(np.int64)
    poses = [
        stop + np.outer(np.arange(count) / count, move)
        for stop, count, move in zip(stops[:-1], counts, moves, strict=True)
    ]
    return np.concatenate([*poses, stops[-1:]])


def _at_stops(name: str, settings: DriveSettings) -> Floats:
    """Return a setting with a number for each stop; zeros by default."""
    values, count = getattr(settings, name), len(settings.stops)
    if not values:
        return np.zeros(count)
    numbers = as_floats(name, values, (None,))
    check_finite(name, numbers)
    if len(numbers) != count:
        raise InputError(name, f"a number for each of the {count} stops", f"{len(numbers)}")
    if np.abs(numbers).max() > FARTHEST:
        raise InputError(name, f"numbers up to {FARTHEST:g}", f"{np.abs(numbers).max():g}")
    return numbers


def _add_drift(poses: Floats, settings: DriveSettings) -> Floats:
    """Return the poses with each move scaled and rotated, as the drift of odometry does."""
    moves = np.diff(poses, axis=0)
    driven = np.cumsum([0.0, *np.hypot(moves[:, 0], moves[:, 1])])
    turn = settings.yaw_drift * driven
    cos, sin = np.cos(turn[:-1]), np.sin(turn[:-1])
    turned = np.column_stack(
        [cos * moves[:, 0] - sin * moves[:, 1], sin * moves[:, 0] + cos * moves[:, 1]]
    )
    places = poses[0, :2] + np.cumsum(
        np.vstack([np.zeros((1, 2)), (1.0 + settings.drift) * turned]), axis=0
    )
    return np.column_stack([places, poses[:, 2] + turn])

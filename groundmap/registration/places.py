"""Location recognition: the pose of a view in a map, without a prior pose."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from os import PathLike
from typing import Any, NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints, as_floats, as_number, check_finite
from groundmap.errors import FileFormatError, InputError, RegistrationError
from groundmap.files.archive import read_archive, write_archive
from groundmap.registration.best_motion import covariance_of, find_motion
from groundmap.registration.feature_set import feature_set
from groundmap.registration.matching import Bounds
from groundmap.registration.motion_model import any_motion
from groundmap.registration.register import NO_LABEL, covariance_in_base, features_of
from groundmap.registration.settings import RegistrationSettings
from groundmap.view.frames import check_transform, invert
from groundmap.view.view import Features, View

FORMAT, VERSION = "groundmap-places", 1
ROUNDS = 4  # of the search at each place; there are many places
SAME_PLACE = 0.5  # [m], distance of poses that are the same answer


class Place(NamedTuple):
    """A pose of the camera, and the features that were seen from it."""

    T_map_camera: Floats  #: shape (4, 4) [m, map]
    points: Features  #: in the camera frame


@dataclass(frozen=True, kw_only=True, eq=False)
class Recognition:
    """The pose of a view in a map, as `groundmap.recognise` determines it.

    Parameters
    ----------
    T_map_base : ndarray, shape (4, 4) [m, map]
    covariance : ndarray, shape (6, 6)
        Of the pose relative to the place: translation [m], then rotation vector [rad], in
        ``base_link``.
    place : int
        Number of the place in `Places.held`.
    matches : int
        Number of features that agree.
    """

    T_map_base: Floats
    covariance: Floats
    place: int
    matches: int


class Places:
    """The places of a map: poses along the drive, with the best features seen from each.

    Parameters
    ----------
    held : list of Place
    """

    def __init__(self, held: list[Place]) -> None:
        self.held = held

    @classmethod
    def of(cls, views: Iterable[View], *, spacing: float = 1.5, most_features: int = 500) -> Places:
        """Return the places of a drive, thinned out.

        Parameters
        ----------
        views : iterable of View
            In their order, with their poses in the map.
        spacing : float, default 1.5 [m]
            Least distance of consecutive places.
        most_features : int, default 500
            Features of a place; those with the least uncertainty are kept.

        Raises
        ------
        InputError
            `spacing` is negative, or `most_features` is below 1.
        """
        spacing = as_number("spacing", spacing, "a number of 0 or more [m]", least=0.0)
        most_features = int(as_number("most_features", most_features, "1 or more", least=1.0))
        held: list[Place] = []
        for view in views:
            position = view.T_map_camera[:3, 3]
            if held and np.linalg.norm(position - held[-1].T_map_camera[:3, 3]) < spacing:
                continue
            spread = np.trace(view.points.covariance, axis1=1, axis2=2)
            best = np.sort(np.argsort(spread, kind="stable")[:most_features])
            held.append(Place(view.T_map_camera, view.points.select(best)))
        return cls(held)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the places to a file, in single precision; an existing file is replaced.

        Raises
        ------
        OSError
            The folder does not exist or is not writable.
        """
        points = [place.points for place in self.held]
        none = _no_points()
        arrays = {
            "T_map_camera": np.array([p.T_map_camera for p in self.held]).reshape(-1, 4, 4),
            "start": np.cumsum([0, *map(len, points)]),
            "xyz": np.concatenate([none.xyz, *(p.xyz for p in points)]).astype(np.float32),
            "covariance": np.concatenate([none.covariance, *(p.covariance for p in points)]).astype(
                np.float32
            ),
        }
        write_archive(path, {"format": FORMAT, "version": VERSION}, arrays)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Places:
        """Read places that `save` wrote.

        Raises
        ------
        FileFormatError
            The file is missing, damaged, of another format or of a newer version.
        """
        _, arrays = read_archive(path, FORMAT, VERSION)
        try:
            poses = as_floats("T_map_camera", arrays["T_map_camera"], (None, 4, 4))
            xyz = as_floats("xyz", arrays["xyz"], (None, 3))
            covariance = as_floats("covariance", arrays["covariance"], (len(xyz), 3, 3))
            check_finite("xyz", xyz)
            check_finite("covariance", covariance)
            start = as_floats("start", arrays["start"], (len(poses) + 1,)).astype(np.int64)
            _check_start(start, len(xyz))
            if not (xyz[:, 2] > 0).all():
                raise InputError("xyz", "features in front of the camera", "others")
            parts = zip(poses, start[:-1], start[1:], strict=True)
            held = [
                Place(
                    check_transform("T_map_camera", pose),
                    Features.points(xyz[a:b], covariance[a:b]),
                )
                for pose, a, b in parts
            ]
        except (KeyError, ValueError) as error:
            raise FileFormatError(path, "a complete file of places", f"{error}") from error
        return cls(held)


def recognise(view: View, places: Places, **settings: Any) -> Recognition:
    """Return the pose of a view in a map, from its features and those of the map's places.

    The view is registered to every place. Its pose and its landmark ids are not used.

    Parameters
    ----------
    view : View
    places : Places
    **settings
        Fields of `groundmap.RegistrationSettings`; ``max_translation`` and ``max_rotation`` are
        the distance from a place within which it is recognised.

    Returns
    -------
    Recognition

    Raises
    ------
    RegistrationError
        No place agrees (``too_few``), or two places agree alike (``ambiguous``).
    SettingsError
        A setting is unknown or out of range.
    """
    options = RegistrationSettings(**{"rounds": ROUNDS, **settings, "use_ids": False})
    seen, model = features_of(view, options), any_motion()
    bounds = Bounds(options.max_translation, options.max_rotation)
    found = []
    for number, place in enumerate(places.held):
        labels = np.full(len(place.points), NO_LABEL)
        try:
            best = find_motion(feature_set(place.points, labels), seen, bounds, model, options)
        except RegistrationError:
            continue
        motion = np.eye(4)
        motion[:3] = best.pose
        T_map_base = place.T_map_camera @ invert(motion) @ invert(view.rig.T_base_camera)
        covariance = covariance_in_base(covariance_of(best, model), view.rig.T_base_camera)
        found.append(
            Recognition(
                T_map_base=T_map_base, covariance=covariance, place=number, matches=best.support
            )
        )
    return _most_certain(found, len(places.held), options)


def _most_certain(
    found: list[Recognition], places: int, options: RegistrationSettings
) -> Recognition:
    if not found:
        raise RegistrationError(
            "too_few", f"the view agrees with none of the {places} places of the map."
        )
    ranked = sorted(found, key=lambda one: -one.matches)
    best = ranked[0]
    for other in ranked[1:]:
        apart = float(np.linalg.norm(other.T_map_base[:3, 3] - best.T_map_base[:3, 3]))
        if apart > SAME_PLACE and other.matches > options.rival * best.matches:
            raise RegistrationError(
                "ambiguous",
                f"the view fits at two poses that are {apart:.3g} m apart alike: {best.matches} "
                f"and {other.matches} features agree.",
            )
    return best


def _check_start(start: Ints, count: int) -> None:
    if start[0] != 0 or start[-1] != count or (np.diff(start) < 0).any():
        raise InputError("start", f"ascending numbers from 0 to {count}", "others")


def _no_points() -> Features:
    return Features.points(np.empty((0, 3)), np.empty((0, 3, 3)))

"""Checks that the ground can be below the camera of a view: its attitude and its ground plane."""

from __future__ import annotations

import numpy as np

from groundmap.arrays import Floats
from groundmap.errors import InputError, NoGroundPlaneError
from groundmap.view.stereo_rig import StereoRig
from groundmap.view.view import View

STEEPEST_SIGHT = np.radians(60.0)  # angle between the optical axis and the horizontal
MOST_LEAN = np.radians(45.0)  # angle between "up" of the base and z of the map
FARTHEST = 1e8  # [m] from the origin; UTM coordinates are within, diverged poses are not


def check_camera(view: View, *, number: int | None = None) -> None:
    """Check that the camera of a view does not look at the ground or the sky.

    Parameters
    ----------
    view : View
    number : int, optional
        Index of the view in its log, for error messages.

    Raises
    ------
    InputError
        The pose is more than 1e8 m from the origin.
    NoGroundPlaneError
        The optical axis is more than 60 degrees off the horizontal, or up of the base more than 45
        degrees off z of the map.
    """
    check_position(view, number=number)
    fault = camera_fault(view.T_map_base, view.rig)
    if fault:
        raise NoGroundPlaneError(f"{name_of(view, number)}: {fault}")


def check_position(view: View, *, number: int | None = None) -> None:
    """Check that a view is not too far from the origin of the map.

    Parameters
    ----------
    view : View
    number : int, optional
        Index of the view in its log, for error messages.

    Raises
    ------
    InputError
        The pose is more than 1e8 m from the origin.
    """
    farthest = float(np.abs(view.T_map_base[:3, 3]).max())
    if farthest > FARTHEST:
        raise InputError(
            "T_map_base",
            f"a position within {FARTHEST:g} m",
            f"{farthest:g} m",
            where=name_of(view, number),
        )


def camera_fault(T_map_base: Floats, rig: StereoRig) -> str:
    """Return why no ground can be below a camera in this pose; an empty text if it can.

    Parameters
    ----------
    T_map_base : ndarray, shape (4, 4) [m, map]
    rig : StereoRig
    """
    axis_up = float(np.clip(T_map_base[2, :3] @ rig.T_base_camera[:3, 2], -1.0, 1.0))
    if abs(axis_up) > np.sin(STEEPEST_SIGHT):
        looks = "sky" if axis_up > 0 else "ground"
        return (
            f"the camera looks at the {looks} ({np.degrees(np.arcsin(axis_up)):+.0f} degrees): "
            "expected an optical axis within 60 degrees of the horizontal. Check the poses, and "
            "whether their world frame is 'optical' or 'rep103'."
        )
    lean = float(np.arccos(np.clip(T_map_base[2, :3] @ rig.up, -1.0, 1.0)))
    if lean > MOST_LEAN:
        return (
            f"up of the base is {np.degrees(lean):.0f} degrees off z of the map: expected at most "
            "45. Check T_base_camera, and whether the world frame of the poses is 'optical' or "
            "'rep103'."
        )
    return ""


def check_plane(view: View, *, number: int | None = None) -> None:
    """Check that a view has a ground plane, and that it is below the camera.

    Parameters
    ----------
    view : View
    number : int, optional
        Index of the view in its log, for error messages.

    Raises
    ------
    NoGroundPlaneError
        The view has no ground plane, or one at or above its camera.
    """
    if view.plane is None:
        raise NoGroundPlaneError(
            f"{name_of(view, number)} has no ground plane: expected views from "
            "groundmap.fit_ground(views), or view.with_plane(plane)"
        )
    camera_height = float(view.plane.height(view.rig.T_base_camera[:3, 3]))
    if not camera_height > 0:
        raise NoGroundPlaneError(
            f"{name_of(view, number)}: expected a ground plane below the camera, got one "
            f"{-camera_height:.3g} m above it. The offset of a GroundPlane is the height of "
            "base_link above the ground [m]. Check it and T_base_camera, or give the height of the "
            "camera above the ground (camera_height=..., --camera-height)."
        )


def name_of(view: View, number: int | None) -> str:
    """Return the name of a view in error messages: its index and timestamp, if they are known.

    Parameters
    ----------
    view : View
    number : int or None
        Index of the view in its log.
    """
    name = "the view" if number is None else f"view {number}"
    return name if view.timestamp is None else f"{name} (timestamp {view.timestamp:.17g} s)"

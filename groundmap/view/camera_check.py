"""Views that no ground can be fitted to are refused: the camera's attitude, the plane."""

from __future__ import annotations

import numpy as np

from groundmap.arrays import Floats
from groundmap.errors import InputError, NoGroundPlaneError
from groundmap.view.stereo_rig import StereoRig
from groundmap.view.view import View

STEEPEST_SIGHT = np.radians(60.0)  # beyond this a camera looks at the ground or the sky
MOST_LEAN = np.radians(45.0)  # between "up" of the base and z of the map
FARTHEST = 1e8  # [m] from the origin: UTM fits in, a diverged pose does not


def check_camera(view: View, *, number: int | None = None) -> None:
    """Refuse a camera that looks at the ground or the sky.

    Parameters
    ----------
    view : View
    number : int, optional
        Index of the view in its log, for the message.

    Raises
    ------
    InputError
        The pose is farther from the origin than any map reaches.
    NoGroundPlaneError
        Its axis is more than 60 degrees off the horizontal, or up is not up in the map.
    """
    farthest = float(np.abs(view.T_map_base[:3, 3]).max())
    if farthest > FARTHEST:
        raise InputError(
            "T_map_base",
            f"a position within {FARTHEST:g} m",
            f"{farthest:g} m",
            where=name_of(view, number),
        )
    fault = camera_fault(view.T_map_base, view.rig)
    if fault:
        raise NoGroundPlaneError(f"{name_of(view, number)}: {fault}")


def camera_fault(T_map_base: Floats, rig: StereoRig) -> str:
    """Return why no ground can be below a camera in this pose: a sentence, empty if it can."""
    axis_up = float(np.clip(T_map_base[2, :3] @ rig.T_base_camera[:3, 2], -1.0, 1.0))
    if abs(axis_up) > np.sin(STEEPEST_SIGHT):
        looks = "sky" if axis_up > 0 else "ground"
        return (
            f"the camera looks at the {looks} ({np.degrees(np.arcsin(axis_up)):+.0f} degrees): "
            "expected an optical axis within 60 degrees of the horizontal. Check the poses and "
            "whether the data's world is 'optical' or 'rep103'."
        )
    lean = float(np.arccos(np.clip(T_map_base[2, :3] @ rig.up, -1.0, 1.0)))
    if lean > MOST_LEAN:
        return (
            f"up of the base is {np.degrees(lean):.0f} degrees off z of the map: expected at most "
            "45. Check T_base_camera and whether the data's world is 'optical' or 'rep103'."
        )
    return ""


def check_plane(view: View, *, number: int | None = None) -> None:
    """Refuse a view without a ground plane, or with one that is not below its camera.

    Parameters
    ----------
    view : View
    number : int, optional
        Index of the view in its log, for the message.

    Raises
    ------
    NoGroundPlaneError
        The view has no plane, or one at or above its camera.
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
            f"{-camera_height:.3g} m above it. GroundPlane's offset is the height of base_link "
            "above the ground, in metres and positive upwards; check it, and T_base_camera, or "
            "give the camera's height above the ground (camera_height=..., --camera-height)."
        )


def name_of(view: View, number: int | None) -> str:
    """Return what messages call a view: its index and its timestamp, as far as they are known."""
    name = "the view" if number is None else f"view {number}"
    return name if view.timestamp is None else f"{name} (timestamp {view.timestamp:.17g} s)"

"""Confidence grids for path planning, from sparse stereo features."""

from groundmap.errors import GroundmapError, RegistrationError
from groundmap.grid.cell_set import CellSet
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.window import CellState, GridWindow
from groundmap.io import load_map, read_views, write_views
from groundmap.mapper import GroundMapper
from groundmap.registration.places import Places, Recognition, recognise
from groundmap.registration.register import Registration, register
from groundmap.registration.settings import RegistrationSettings
from groundmap.registration.trajectory import Trajectory, estimate_poses
from groundmap.settings import GroundSettings, MapperSettings
from groundmap.view.ground_fit import fit_ground
from groundmap.view.ground_plane import GroundPlane
from groundmap.view.jumps import pose_jumps
from groundmap.view.stereo_rig import StereoRig
from groundmap.view.view import Features, View

__all__ = [
    "CellSet",
    "CellState",
    "ConfidenceGrid",
    "Features",
    "GridWindow",
    "GroundMapper",
    "GroundPlane",
    "GroundSettings",
    "GroundmapError",
    "MapperSettings",
    "Places",
    "Recognition",
    "Registration",
    "RegistrationError",
    "RegistrationSettings",
    "StereoRig",
    "Trajectory",
    "View",
    "estimate_poses",
    "fit_ground",
    "load_map",
    "pose_jumps",
    "read_views",
    "recognise",
    "register",
    "write_views",
]

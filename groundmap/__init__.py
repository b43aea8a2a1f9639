"""From sparse stereo features to a map one can plan on."""

from groundmap.camera import StereoRig
from groundmap.errors import GroundmapError
from groundmap.features import Features, View
from groundmap.grid import ConfidenceGrid
from groundmap.ground import GroundPlane
from groundmap.ground_fit import fit_ground
from groundmap.io import load_map, read_views, write_views
from groundmap.jumps import pose_jumps
from groundmap.mapper import GroundMapper
from groundmap.settings import GroundSettings, MapperSettings
from groundmap.window import CellState, GridWindow

__all__ = [
    "CellState",
    "ConfidenceGrid",
    "Features",
    "GridWindow",
    "GroundMapper",
    "GroundPlane",
    "GroundSettings",
    "GroundmapError",
    "MapperSettings",
    "StereoRig",
    "View",
    "fit_ground",
    "load_map",
    "pose_jumps",
    "read_views",
    "write_views",
]

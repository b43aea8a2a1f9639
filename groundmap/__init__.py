"""From sparse stereo features to a map one can plan on."""

from groundmap.camera import StereoRig
from groundmap.errors import GroundmapError
from groundmap.features import Features, View
from groundmap.grid import ConfidenceGrid
from groundmap.window import CellState, GridWindow

__all__ = [
    "CellState",
    "ConfidenceGrid",
    "Features",
    "GridWindow",
    "GroundmapError",
    "StereoRig",
    "View",
]

"""Simulated worlds with ground truth, and a stereo sensor that observes them."""

from groundmap.simulate.drive import Drive, DriveSettings, drive
from groundmap.simulate.landmarks import Landmarks, sample_landmarks
from groundmap.simulate.observe import observe
from groundmap.simulate.relief import Relief
from groundmap.simulate.sensor import SensorSettings
from groundmap.simulate.world import Hole, Solid, World

__all__ = [
    "Drive",
    "DriveSettings",
    "Hole",
    "Landmarks",
    "Relief",
    "SensorSettings",
    "Solid",
    "World",
    "drive",
    "observe",
    "sample_landmarks",
]

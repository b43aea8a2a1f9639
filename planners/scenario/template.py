"""The file that `groundmap scenario new` writes."""

from __future__ import annotations

from pathlib import Path

from groundmap.errors import FileFormatError, InputError
from groundmap.files.archive import write_atomically
from planners.scenario.case import FILE

TEMPLATE = '''\
# A scenario: a simulated world, how it is mapped, and bounds on the figures of map and routes.
# Run it with: groundmap scenario run {folder}
# Metres, radians (headings of stops: degrees), seconds.

why = """
State the purpose of the scenario: the property that its bounds check.
"""
seed = 1                     # seed of all random numbers

[world]                      # or [log] path = "...", a recorded log instead of a world
kind = "empty"               # {kinds}
bounds = [0, 0, 10, 6]       # of the textured ground: xmin, ymin, xmax, ymax
ground_texture = 12.0        # point features on the ground [1/m²]

[[world.solids]]             # one table per solid
wall = [[0, 0], [10, 0], [10, 6], [0, 6], [0, 0]]   # centre line
thickness = 0.2
top = 2.5                    # height of the top edge; `bottom` is that of the bottom edge
texture = 12.0               # point features on the surfaces [1/m²]

[[world.solids]]
box = [4, 2, 5, 3]           # or pole = [x, y], polygon = [[x, y], ...], table = [x0, y0, x1, y1]
top = 1.0
# appears = 5.0              # time at which it appears; vanishes = ... at which it vanishes
# transparent = true         # glass
# edges = false              # without segment features on its edges

# [[world.holes]]            # lowered ground
# box = [7, 1, 8, 2]
# depth = 0.5

[sensor]
fx = 700.0                   # [px]
baseline = 0.54
camera_height = 1.0
pixel_noise_px = 0.5
missing = 0.1                # share of the visible features that are not matched
false_matches = 0.02         # share that is matched with a random disparity

[drive]
stops = [                    # x, y, heading [deg]
    [1, 1, 0], [8.5, 1, 0], [8.5, 1, 90], [8.5, 4.8, 90], [8.5, 4.8, 180],
    [1.5, 4.8, 180], [1.5, 4.8, 270], [1.5, 1.5, 270],
]
every = 0.5                  # distance between views, at most

[mapper]                     # as in the settings file of `groundmap map`
resolution = 0.1524

[[queries]]                  # routes to plan
name = "around"
start = [1.5, 1.2]
goal = [8, 4.5]
footprint = 0.3              # radius to plan with, or an outline: [[x, y], ...]
robot_radius = 0.25          # radius that must not touch the true world
expect = "route"             # or an error: EnclosedError, NonFreeError, UnknownSpaceError, ...
# reason = "enclosed"        # regular expression that matches in the message of the error
# unknown = "allow"          # unknown and contested space: avoid, allow or penalise
# time_limit = 2.0           # time limit of planning
# settings = {{ weight = 1 }}  # settings of the planner
max_ratio = 1.1              # most length, divided by that of the best route in the true world

[bounds]                     # min, max, or both, for any figure that `scenario run` prints
free_recall = {{ min = 0.9 }}
false_free_beyond = {{ max = 0.01 }}
'''


def write_template(place: Path, name: str, kinds: list[str]) -> Path:
    """Write a commented scenario to a new folder, and return the path of its file.

    Parameters
    ----------
    place : Path
        Parent of the new folder.
    name : str
        Name of the new folder.
    kinds : list of str
        Kinds of worlds, listed in a comment.

    Raises
    ------
    FileFormatError
        The folder contains a scenario already.
    InputError
        The name is not that of a single folder.
    """
    folder = place / name
    if folder.name != name or name in ("", ".", ".."):
        raise InputError("name", "the name of one folder", repr(name))
    path = folder / FILE
    if path.exists():
        raise FileFormatError(path, "no scenario there yet", "one", hint="Give another name.")
    folder.mkdir(parents=True, exist_ok=True)
    text = TEMPLATE.format(folder=folder, kinds=", ".join(kinds))
    write_atomically(path, lambda stream: stream.write(text.encode()))
    return path

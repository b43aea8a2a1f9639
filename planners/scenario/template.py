"""The file that `groundmap scenario new` starts a scenario with."""

from __future__ import annotations

from pathlib import Path

from groundmap.errors import FileFormatError, InputError
from groundmap.files.archive import write_atomically
from planners.scenario.case import FILE

TEMPLATE = '''\
# A scenario: a world that is known, what is mapped of it, and the bounds that it must keep.
# Run it with: groundmap scenario run {folder}
# Metres, radians (headings of stops: degrees), seconds.

why = """
Say what would break if this case did: the reason that the scenario exists.
"""
seed = 1                     # of all random numbers

[world]                      # or [log] path = "...", a recorded log instead of a world
kind = "empty"               # {kinds}
bounds = [0, 0, 10, 6]       # of the ground with texture: xmin, ymin, xmax, ymax
ground_texture = 12.0        # point features on it [1/m²]

[[world.solids]]             # what stands there; one table each
wall = [[0, 0], [10, 0], [10, 6], [0, 6], [0, 0]]   # its centre line
thickness = 0.2
top = 2.5                    # height; `bottom` lifts it off the ground
texture = 12.0               # point features on it [1/m²]

[[world.solids]]
box = [4, 2, 5, 3]           # or pole = [x, y], polygon = [[x, y], ...], table = [x0, y0, x1, y1]
top = 1.0
# appears = 5.0              # there since when; vanishes = ... until when
# transparent = true         # glass
# edges = false              # its edges are not matched as segments

# [[world.holes]]            # ground that lies lower
# box = [7, 1, 8, 2]
# depth = 0.5

[sensor]
fx = 700.0                   # [px]
baseline = 0.54
camera_height = 1.0
pixel_noise_px = 0.5
missing = 0.1                # share of the features in sight that are not matched
false_matches = 0.02         # share that is matched with any disparity

[drive]
stops = [                    # x, y, heading [deg]
    [1, 1, 0], [8.5, 1, 0], [8.5, 1, 90], [8.5, 4.8, 90], [8.5, 4.8, 180],
    [1.5, 4.8, 180], [1.5, 4.8, 270], [1.5, 1.5, 270],
]
every = 0.5                  # a view at least this often

[mapper]                     # as in the settings file of `groundmap map`
resolution = 0.1524

[[queries]]                  # routes to ask for
name = "around"
start = [1.5, 1.2]
goal = [8, 4.5]
footprint = 0.3              # radius to plan with, or an outline: [[x, y], ...]
robot_radius = 0.25          # what must not touch the true world
expect = "route"             # or the error: EnclosedError, NonFreeError, UnknownSpaceError, ...
# reason = "enclosed"       # what the error's sentence holds: a regular expression
# unknown = "allow"          # unknown and contested space: avoid, allow or penalise
# time_limit = 2.0           # search time
# settings = {{ weight = 1 }}  # of the planner
max_ratio = 1.1              # to the best route in the true world

[bounds]                     # min, max, or both, for any figure that a run prints
free_recall = {{ min = 0.9 }}
false_free_beyond = {{ max = 0.01 }}
'''


def write_template(place: Path, name: str, kinds: list[str]) -> Path:
    """Write a commented scenario into a new folder of a place, and return its file.

    Raises
    ------
    FileFormatError
        There is a scenario already.
    InputError
        A name that is no single folder's.
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

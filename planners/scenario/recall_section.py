"""The report's section on why one triangulates."""

from __future__ import annotations

from groundmap import draw
from planners.compare.recall import compare_recall
from planners.scenario.report import Section

SHOWN = (50, 100, 300)  # features in a view, in the table
TEXT = """
What a single view shows of 20 random rooms with boxes: features triangulated, against as many
thin rays, each cell updated once per view. Left, the share of the truly visible freespace that is
found; right, the share of what is called free that is wrong by more than 0.3 m.
"""


def why_one_triangulates() -> Section:
    """Return the curves of recall over the number of features, for both systems."""
    found = compare_recall()
    curves = {
        "points, triangulated": found.points,
        "segments, triangulated": found.segments,
        "points, as rays": found.rays,
    }
    rows = [("features", *curves)]
    for count in SHOWN:
        row = [str(count)]
        for curve in curves.values():
            at = list(curve.counts).index(count)
            row.append(f"{curve.free_recall[at]:.3f} / {curve.false_free_beyond[at]:.4f}")
        rows.append(tuple(row))
    return Section(
        title="Why one triangulates",
        text=" ".join(TEXT.split()),
        picture=draw.curves_png(curves),
        rows=rows,
    )

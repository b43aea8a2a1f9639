"""The section of the report that compares triangulation with ray casting."""

from __future__ import annotations

from groundmap import draw
from planners.compare.recall import compare_recall
from planners.scenario.report import Section

SHOWN = (50, 100, 300)  # features in a view, in the table
TEXT = """
Freespace found in a single view of 20 random rooms with boxes: by triangulation, and by as many
thin rays with each cell updated once per view. Left, the share of the truly visible freespace that
is found; right, the share of the free cells that are wrong by more than 0.3 m.
"""


def triangulation_section() -> Section:
    """Return the curves of recall over the number of features, for both methods."""
    recall = compare_recall()
    curves = {
        "points, triangulated": recall.points,
        "segments, triangulated": recall.segments,
        "points, as rays": recall.rays,
    }
    rows = [("features", *curves)]
    for count in SHOWN:
        row = [str(count)]
        for curve in curves.values():
            at = list(curve.counts).index(count)
            row.append(f"{curve.free_recall[at]:.3f} / {curve.false_free_beyond[at]:.4f}")
        rows.append(tuple(row))
    return Section(
        title="Triangulation and ray casting",
        text=" ".join(TEXT.split()),
        picture=draw.curves_png(curves),
        rows=rows,
    )

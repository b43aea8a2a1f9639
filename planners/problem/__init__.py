"""The planning problem: start, goal, footprint, costs."""

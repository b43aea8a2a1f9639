"""The map of a problem: where the footprint fits, and the costs of cells."""

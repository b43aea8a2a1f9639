"""The map as a problem sees it: where the footprint fits, and what cells cost."""

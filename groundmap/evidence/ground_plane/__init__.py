"""Evidence of a 2-D map, built in the ground plane."""

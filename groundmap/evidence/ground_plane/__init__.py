"""Evidence for 2-D maps, computed in the ground plane."""

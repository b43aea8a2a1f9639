"""Compiled loops of the builder of 3-D maps."""

"""Numba kernels of the update rules."""

"""Numba kernels of the costmap."""

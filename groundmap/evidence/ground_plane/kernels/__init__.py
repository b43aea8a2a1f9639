"""Numba kernels of the 2-D evidence."""

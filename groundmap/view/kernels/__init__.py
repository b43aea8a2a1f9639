"""Numba kernels of ground strips."""

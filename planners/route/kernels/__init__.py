"""Numba kernels of shortcuts and smoothing."""

"""Numba kernels of the simulated sensor."""

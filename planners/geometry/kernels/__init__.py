"""Numba kernels of clearance, curves and swept footprints."""

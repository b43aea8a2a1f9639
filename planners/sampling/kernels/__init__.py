"""Numba kernels that check and measure edges between sampled states."""

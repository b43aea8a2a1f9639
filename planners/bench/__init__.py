"""Benchmarks: the speed of planners, and their lengths compared with published ones."""

"""Sampling planners: OMPL over the costmap, its edges checked by our own kernels."""

"""Sparse maps of SLAM and structure from motion: landmarks, poses, and which view saw which."""

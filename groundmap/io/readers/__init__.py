"""Readers of the sparse maps of SLAM and structure-from-motion systems, a file for each."""

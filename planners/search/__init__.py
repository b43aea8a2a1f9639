"""Searches over cells, meshes and poses; they bring back waypoints."""

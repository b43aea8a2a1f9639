"""Peers: other ways from views to a map, and what they reach on the same views."""

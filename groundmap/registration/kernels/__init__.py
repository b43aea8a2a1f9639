"""Compiled loops of the registration."""

"""Scenarios: worlds that are known, what is mapped of them, and the bounds that it must keep."""

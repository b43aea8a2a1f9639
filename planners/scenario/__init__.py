"""Scenarios: simulated worlds or logs, and the bounds that their maps must keep."""

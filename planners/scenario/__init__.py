"""Scenarios: simulated worlds or logs, with bounds on the figures of their maps and routes."""

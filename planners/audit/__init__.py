"""The last check of every route, by code that no planner uses."""

"""Benchmarks: how fast planners are, and whether they find published lengths."""

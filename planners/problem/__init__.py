"""What is asked of a planner: start, goal, footprint, costs."""

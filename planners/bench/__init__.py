"""How fast planners are, and whether they find what others published."""

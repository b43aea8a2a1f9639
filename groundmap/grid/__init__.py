"""The confidence grid: tiles, height layers, update rules and map files."""

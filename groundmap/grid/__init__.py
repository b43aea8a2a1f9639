"""What is known: cells, tiles, files of maps, and the update rules."""

"""The commands of ``groundmap``, one per file, and their console output."""

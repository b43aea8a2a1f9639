"""The commands of ``groundmap``, one per file."""

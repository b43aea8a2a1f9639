"""Routes: measured, audited, shortened, smoothed and written to files."""

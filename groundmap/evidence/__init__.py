"""What one view says about the cells around it."""

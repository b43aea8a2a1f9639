"""Registration: the motion between two views, from their features alone."""

"""Other mapping methods on the same views, to compare with."""

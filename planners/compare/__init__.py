"""Other ways from views to a map, on the same views."""

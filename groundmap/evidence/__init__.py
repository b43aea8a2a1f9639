"""Evidence: free and non-free values of the cells around one view."""

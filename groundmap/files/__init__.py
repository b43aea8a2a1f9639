"""Reading and writing of whole files: documents, arrays, and archives of this package."""

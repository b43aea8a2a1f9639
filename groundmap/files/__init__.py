"""Files opened, read and written whole: documents, arrays, our own archives."""

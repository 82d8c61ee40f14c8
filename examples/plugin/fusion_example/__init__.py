"""One plug-in of every kind, each complete in a file of its own."""

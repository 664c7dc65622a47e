"""`shapechanger robot`: set up, serve, find, drive and test robots."""

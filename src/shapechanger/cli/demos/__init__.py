"""`shapechanger demos`: record, inspect, edit, share and learn from demonstrations."""

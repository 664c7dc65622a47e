"""Guard: the process that owns every output, and its safety rules."""

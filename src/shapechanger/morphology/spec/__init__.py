"""Work on an `MjSpec` that edits share: finding, naming, measuring, stretching, grafting."""

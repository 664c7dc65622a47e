"""The edits: one class for each change to a model."""

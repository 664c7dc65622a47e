"""Tasks of a user's own, without bodies."""

"""Tasks without bodies: rewards, ends of episodes, and paths to follow."""

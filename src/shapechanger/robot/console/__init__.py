"""Web page on which a person drives and records; `daemon.server` serves its files."""

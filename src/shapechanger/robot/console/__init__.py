"""Web page on which a person drives and records, and the loader of its files."""

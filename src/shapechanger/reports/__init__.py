"""What pages are made of: a template, pictures, charts and formatted numbers."""

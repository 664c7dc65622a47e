"""Parts of report pages: template, pictures, charts and formatted numbers."""

"""Parts of report pages: template, images, charts and formatted numbers."""

"""Reports as self-contained HTML files: of studies, demonstrations, clones and fingers."""

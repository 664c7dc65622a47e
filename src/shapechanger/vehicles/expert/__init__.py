"""Expert driving with full knowledge of the course: planned paths, progress and a driver."""

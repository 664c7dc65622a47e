"""Pages of studies and suites; need the extra `report`."""

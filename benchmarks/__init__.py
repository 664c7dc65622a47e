"""Benchmarks of every number that Shapechanger states."""

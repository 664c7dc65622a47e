"""Benchmarks that measure the numbers in the documentation."""

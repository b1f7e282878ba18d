"""Benchmarks: each script prints a table; run as `python -m benchmarks.NAME`."""

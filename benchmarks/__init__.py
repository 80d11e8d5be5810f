"""Measurements of cost: `python -m benchmarks [group ...]`. Nothing here is cached or tested for speed."""

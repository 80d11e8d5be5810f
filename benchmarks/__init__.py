"""Measurements of this program: `python -m benchmarks [FAMILY ...]`; `--list` says what there is."""

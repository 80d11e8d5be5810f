"""Pages of docs/ that follow from the sources alone: ``python -m benchmarks.site`` writes them."""

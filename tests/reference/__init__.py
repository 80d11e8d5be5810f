"""Independent solutions: NumPy and SciPy only, written from the mathematics, nothing of pipeline imported."""

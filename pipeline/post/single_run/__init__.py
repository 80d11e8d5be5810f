"""What follows from one run: series, impacts, wear, horizon."""

"""Results that follow from one run: series, impacts, wear, horizon."""

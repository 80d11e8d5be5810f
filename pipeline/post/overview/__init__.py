"""What one sees of any mechanism: figures of a run, runs beside each other, and the page with both."""

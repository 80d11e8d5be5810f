"""What one sees of any mechanism: figures of a run, runs next to each other, and the page with both."""

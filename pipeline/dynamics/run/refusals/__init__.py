"""What ends a run, or is doubted in it, in words."""

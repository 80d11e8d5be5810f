"""From a consistent start to a finished run."""

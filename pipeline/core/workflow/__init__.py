"""Content-keyed workflow: what a task is, when it is fresh, and how stale ones are run."""

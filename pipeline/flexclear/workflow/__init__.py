"""Content-keyed workflow: tasks, the check that they are up to date, and the execution of stale tasks."""

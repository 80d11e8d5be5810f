"""Studies of a scene by many runs, and pages about them: what commands and public functions do."""

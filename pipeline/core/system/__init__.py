"""The machine and the process: errors, files, logs, what systems do differently."""

"""The machine and the process: errors, files, logs, differences between operating systems."""

"""The commands: a module for each verb with `arguments` and `command`."""

"""Commands: a module for each verb with `arguments` and `command`."""

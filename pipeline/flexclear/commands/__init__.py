"""Commands: a module for each verb with `add_arguments` and `run_command`."""

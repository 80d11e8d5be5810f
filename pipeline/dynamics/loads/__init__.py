"""Loads. To add one: a module here, a line below, its parameters in the scene schema."""

KIND = "load"
NAMES = {"gravity": "gravity:field"}

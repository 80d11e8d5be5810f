"""Scenes, artifacts and workflow, which all towers use. Imports nothing from the towers."""

"""What every tower shares: scenes, artifacts, workflow. Imports nothing from the towers."""

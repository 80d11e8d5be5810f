"""From a recipe to a reduced modal bundle: finite elements (fe) and modes. Depends on: flexclear.pipeline.core."""

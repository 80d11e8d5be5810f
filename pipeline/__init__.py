"""From a mesh recipe to maps and pages: the towers structure, dynamics and post, on one core."""

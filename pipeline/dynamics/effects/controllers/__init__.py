"""Controllers along joint coordinates: samples, divergence, and what they do."""

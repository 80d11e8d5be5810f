"""Controllers of joint coordinates: samples, divergence checks, and recorded forces."""

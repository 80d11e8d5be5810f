"""Contact: forces from a normal law and a friction law, stiffness from geometry and materials."""

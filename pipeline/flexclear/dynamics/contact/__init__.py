"""Contact: forces of a normal law and a friction law, stiffness from geometry and materials."""

"""Motion over singular poses, and out of them."""

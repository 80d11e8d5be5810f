"""Over singular poses, and out of them."""

"""Measurements of cost. `make bench` runs all of them; nothing here is cached or tested for speed."""

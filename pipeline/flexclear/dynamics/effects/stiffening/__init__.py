"""Shortening of beams by bending, which stiffens them when they rotate or are pulled."""

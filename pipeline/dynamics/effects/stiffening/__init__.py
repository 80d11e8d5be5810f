"""Bending shortens beams, which stiffens them when they turn or are pulled."""

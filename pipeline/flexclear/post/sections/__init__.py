"""Poincare sections: periodic, quasi-periodic or chaotic, and the page about it."""

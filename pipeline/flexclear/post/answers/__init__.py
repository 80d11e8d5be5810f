"""Stability, effects and plans as tables, figures, sentences and pages."""

"""Stages from mesh recipe to pictures and verdicts, the tasks of a scene (`graph`), and sweeps of many points."""

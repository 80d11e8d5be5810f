"""The stages from recipe to pictures and verdicts, and the tasks of a scene (`graph`); `sweeps` of many points."""

"""Studies of a scene by many runs, and pages about them: what commands and public functions do.

`members` runs variants of a scene, over as many members as decide, within one budget; each run is a task of
`stages.variant_runs`, and hence made once. `cost`, `effects`, `compare` and the verification of plans say which
variants, and when to stop; a task then compares the runs (`members.comparing_task`). `sweep` runs points of one variant
in workers.
"""

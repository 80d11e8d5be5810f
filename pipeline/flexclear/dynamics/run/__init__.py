"""Integration of a scene's motion.

Modules that only some scenes need are listed here; `effects.ways` decides which scenes. Only `effects.way` imports
them, so that they are in the keys of those runs and of no others.
"""

KIND = "way of a run"
NAMES = {
    "accuracy": "method_choice.accuracy",
    "beginning": "singular_poses.beginning",
    "collocation": "singular_poses.collocation",
    "expressions": ".compile.formulas",
    "frames to a tolerance": ".model.fitting",
    "horizon": "horizon.horizon:Pair",
    "inverse dynamics": "inverse:actuated",
    "method selection": "method_choice.method_selection:method_costs",
    "passing": "singular_poses.passing",
}

"""Integration of a scene's motion.

What the runs of some scenes call for and those of others never do is listed here; which those are, `effects.ways`
says. It is imported by `effects.way` alone, so that it is in the keys of those runs and of no others.
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
    "method selection": "method_choice.method_selection:suit",
    "passing": "singular_poses.passing",
}

"""Reference conditions: what ties the body frame to the deforming body, and so which shapes are admissible.

To add one: a module here with ``condition(model, given) -> Condition``, and a line below.
"""

KIND = "reference condition"
NAMES = {
    "free-free": "free_free:condition",
    "fixed-fixed": "fixed_fixed:condition",
    "cantilever": "cantilever:condition",
    "pinned-pinned": "pinned_pinned:condition",
    "constrained": "constrained:condition",
    "mean-axis": "mean_axis:condition",
    "craig-bampton": "craig_bampton:condition",
    "craig-chang": "craig_chang:condition",
    "residual-flexibility": "residual_flexibility:condition",
}

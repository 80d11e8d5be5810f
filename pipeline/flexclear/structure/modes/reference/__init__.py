"""Reference conditions: they tie the body frame to the deforming body, and so define the admissible shapes.

To add one: a function ``(model, given) -> Condition`` in `held` or `floating`, and a line below.
"""

from __future__ import annotations

from flexclear.structure.modes.reference import floating, held

CONDITIONS = {
    "free-free": floating.free_free,
    "fixed-fixed": held.fixed_fixed,
    "cantilever": held.cantilever,
    "pinned-pinned": held.pinned_pinned,
    "constrained": held.hold_motions,
    "mean-axis": floating.mean_axis,
    "craig-bampton": held.craig_bampton,
    "given": held.given_shapes,
    "craig-chang": floating.craig_chang,
    "residual-flexibility": floating.residual_flexibility,
}

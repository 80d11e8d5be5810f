"""Integrators. To add one: a module with a `METHOD` (see `method`), a line below, a row in the order test,
and its parameters in `pipeline.core.scene.solver`.

`stepper` runs any method, with steps that `adaptive` or `fixed` choose; `events` locates contacts in
its steps (`step_ends` does not), `project` keeps loops closed, `observe` evaluates what is recorded.
"""

KIND = "integrator"
#: methods that add displacements by the joints' own rule
RETRACTING = ("generalized-alpha",)
#: implicit methods that take over where an explicit one crawls
HEIRS = {"dop853": "radau", "dopri5": "radau"}
NAMES = {
    "dop853": "dop853:METHOD",
    "dopri5": "dopri5:METHOD",
    "rk4": "rk4:METHOD",
    "adams-bashforth-moulton": "adams:METHOD",
    "generalized-alpha": "generalized_alpha:METHOD",
    "radau": "radau:METHOD",
}

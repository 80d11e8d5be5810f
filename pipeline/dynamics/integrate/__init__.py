"""Integrators. To add one: a module with a `METHOD` (see `method`), a line in `pipeline.core.scene.integrators`, a row
in the order test, and parameters of its own, if it has any, in `pipeline.core.scene.solver`.

`stepper` runs any method, with steps that `adaptive` or `fixed` choose; `contact_events` locates contacts in its steps
(`step_end_events` does not), `contact_phases` follows what happens inside them, `guards` end steps where friction
bends, `singular_step` steps over singular poses, `recording` writes down. Methods share `runge_kutta`, `newton`,
`hermite` and `norms`.
"""

from flexclear.pipeline.core.scene.integrators import INTEGRATORS

KIND = "integrator"
NAMES = {name: f"{traits.module}:METHOD" for name, traits in INTEGRATORS.items()}

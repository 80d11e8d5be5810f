"""Integrators. To add one: write a module with a `METHOD` (see `method`), a line in `scene.integrators`,
a row in the order test, and its parameters, if it has any, in `scene.solver`.

`stepper` runs any method; `adaptive` or `fixed` choose the length of its steps. `contact_events` locates the begin and
end of contacts within steps, `step_end_events` only at step ends. `contact_phases` records what happens during contact,
`guards` end steps where a friction law has a kink, `singular_step` steps over singular poses, `recording` stores rows.
Methods share `runge_kutta`, `newton`, `hermite` and `norms`.
"""

from flexclear.scene.integrators import INTEGRATORS

KIND = "integrator"
NAMES = {name: f"{traits.module}:METHOD" for name, traits in INTEGRATORS.items()}

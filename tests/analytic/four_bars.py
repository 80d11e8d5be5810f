"""N parallelograms side by side (IFToMM benchmark A02): scene files, and the motion of their one freedom.

`python -m tests.analytic.four_bars` writes the scenes again.
"""

from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

#: rods of 1 m and 1 kg, gravity, and the start velocity of the tops [m/s]
GRAVITY, SPEED = 9.81, 1.0
LOOPS = (1, 2, 40)
ROD = "[0.08333333333333333, 0.0, 0.08333333333333333]"
BEAM = "[0.0, 0.08333333333333333, 0.08333333333333333]"


def path(loops: int) -> Path:
    """Where the scene of so many loops stands."""
    return Path(__file__).resolve().parents[2] / "scenes" / "checks" / f"four_bars_{loops}.toml"


def text(loops: int, end: float = 10.0, interval: float = 0.1) -> str:
    """The scene file: rods 0..N stand on ground pins, beams 1..N join their tops, all by revolute joints in space."""
    lines = [
        "# written by tests/analytic/four_bars.py",
        f'title = "{loops} four-bar loop{"s" if loops > 1 else ""} in a row, passing singular poses"',
        'description = "IFToMM benchmark A02. When the rods lie, every loop may turn into an antiparallelogram."',
        'source = "Gonzalez et al. (2006), library of multibody benchmark problems, A02"',
        "",
        "[body.ground]",
        'type = "ground"',
        *(f"frames.pin{k} = {{ position = [{k}.0, 0.0, 0.0] }}" for k in range(loops + 1)),
    ]
    for k in range(loops + 1):
        lines += [
            "", f"[body.rod{k}]", 'type = "rigid"', "mass = 1.0", "com = [0.0, 0.5, 0.0]", f"inertia = {ROD}",
            f"pose = {{ position = [{k}.0, 0.0, 0.0] }}", f"velocity = [{0.5 * SPEED}, 0.0, 0.0]",
            f"angular_velocity = [0.0, 0.0, {-SPEED}]", "frames.foot = {}",
            "frames.top = { position = [0.0, 1.0, 0.0] }",
        ]  # fmt: skip
    for k in range(1, loops + 1):
        lines += [
            "", f"[body.beam{k}]", 'type = "rigid"', "mass = 1.0", "com = [0.5, 0.0, 0.0]", f"inertia = {BEAM}",
            f"pose = {{ position = [{k - 1}.0, 1.0, 0.0] }}", f"velocity = [{SPEED}, 0.0, 0.0]",
            "angular_velocity = [0.0, 0.0, 0.0]", "frames.left = {}", "frames.right = { position = [1.0, 0.0, 0.0] }",
        ]  # fmt: skip
    lines += ["", "[joint]"]
    lines += [_pin(f"foot{k}", f"ground.pin{k}", f"rod{k}.foot") for k in range(loops + 1)]
    for k in range(1, loops + 1):
        lines += [
            _pin(f"left{k}", f"rod{k - 1}.top", f"beam{k}.left"),
            _pin(f"right{k}", f"beam{k}.right", f"rod{k}.top"),
        ]
    lines += [
        "", "[load.gravity]", 'type = "gravity"', f"acceleration = [0.0, {-GRAVITY}, 0.0]",
        "", "[time]", f"end = {end}", "", "[output]", f"interval = {interval}", "",
    ]  # fmt: skip
    return "\n".join(lines)


def _pin(name: str, a: str, b: str) -> str:
    return f'{name} = {{ type = "revolute", between = ["{a}", "{b}"] }}'


def inclination(loops: int, times: np.ndarray) -> np.ndarray:
    """Angle of the rods from the vertical [rad] on the regular branch, where all stay parallel.

    Per rod (N + 1 of them) the moment of inertia 1/3 kg m^2 and the moment of weight 1/2 m; the N beams only
    translate, as points at the tops.
    """
    inertia, weight = (loops + 1) / 3.0 + loops, (loops + 1) / 2.0 + loops

    def rhs(_: float, y: np.ndarray) -> list[float]:
        return [y[1], GRAVITY * weight / inertia * np.sin(y[0])]

    known = solve_ivp(rhs, (0.0, times[-1]), [0.0, SPEED], "DOP853", t_eval=times, rtol=3e-14, atol=1e-13)
    return np.asarray(known.y[0])


if __name__ == "__main__":
    for number in LOOPS:
        path(number).write_text(text(number))

"""Whether what a scene prescribes repeats: laws of time, and expressions of loads that contain the time."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from flexclear.artifacts.quantities import evaluate_postfix
from flexclear.dynamics import memory as m
from flexclear.dynamics.model.driving import coordinate_of, label, prescribed_coordinates
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.scene.expression import Lookup
from flexclear.scene.formulas import expressions_of_load
from flexclear.scene.loads import EXPRESSIONS
from flexclear.scene.quantity import Quantity
from flexclear.system.errors import InputError

#: laws repeat when their values at both ends of a period agree to this fraction, expressions at all times in it
EQUAL = 1e-6
#: times of the period, and random motions, at which expressions are compared; sizes of what they read, as powers of ten
TIMES, MOTIONS, SIZES = 32, 64, (-4.0, 2.0)


def require_periodic(parts: list[Engine], y: np.ndarray) -> None:
    """Raise InputError unless something depends on time, and all of that repeats.

    Laws end the period with their initial values, drives also with the rates; whole turns of a driven angle are no
    difference. Expressions of loads have the same values a period later, whatever the motion.
    """
    model, period = parts[0].model, parts[-1].end - parts[0].start
    scene, driven, values = model.scene, prescribed_coordinates(model.scene), []
    for part, t in ((parts[0], parts[0].start), (parts[-1], parts[-1].end)):
        part.select_pieces_after(t)
        part.attempt(y, t)
        laws = part.table(m.LAW)
        values.append(np.stack([laws["value"], laws["rate"]], axis=1))
    change, first = values[1] - values[0], {name: int(row["law0"]) for name, row in model.rows_of(object).items()}
    grown = dict(zip((one.name for one in driven), change[:, 0].tolist(), strict=False))
    formulas = {
        name: [steps for _, steps in expressions_of_load(scene, scene.load[name])]
        for name in model.rows_of(*EXPRESSIONS)
    }
    timed = {name for name, texts in formulas.items() for steps in texts if any(_is_time(step) for step in steps)}
    for name, texts in formulas.items():
        change[first[name]] = 0.0  # the time itself, which its expression reads
        if not all(_repeats(steps, parts[0].start, period, _changes(scene, grown)) for steps in texts):
            raise InputError(
                f"[load.{name}.force]",
                f"its expression {'depends on t' if name in timed else 'reads a driven angle'} and does not repeat "
                f"after a period of {period:.6g} s",
                "give its period as sections.period, or a force that is the same a period later",
            )
    if len(change) == len(formulas) - len(timed):
        raise InputError(
            "[sections]", "no period: neither a drive nor a load has a law of time", "drive a joint, or vary a load"
        )
    turning = [k for k, drive in enumerate(driven) if drive.dimension == "angle"]
    change[turning, 0] = (change[turning, 0] + np.pi) % (2.0 * np.pi) - np.pi
    change[len(driven) :, 1] = 0.0  # a load's rate may jump
    least = np.where(np.arange(len(change)) < len(driven), EQUAL, 1.0)[:, None] * [1.0, 1.0 / period]
    wrong = np.argwhere(np.abs(change) > EQUAL * (np.abs(values).max(axis=0) + least))
    if len(wrong):
        k, rate = wrong[0]
        of_load = max((name for name in first if first[name] <= k), key=first.__getitem__, default="")
        raise InputError(
            f"[drive.{driven[k].name}]" if k < len(driven) else f"[load.{of_load}]",
            f"its law does not repeat after a period of {period:.6g} s: its {'rate' if rate else 'value'} has changed "
            f"by {change[k, rate]:.3g}",
            "give the laws' period as sections.period, or choose laws whose period ends as it begins",
        )


def _is_time(step: Any) -> bool:
    return isinstance(step, Quantity) and step.kind == "t"


def _changes(scene: Any, grown: Mapping[str, float]) -> dict[str, float]:
    """Return the change of each driven coordinate over a period, full turns counted, by the coordinate's name.

    grown: by the drive's name.
    """
    changes = {}
    for name, drive in scene.drive.items():
        if hasattr(drive, "joint"):
            joint, k, _ = coordinate_of(scene, drive.joint, drive.coordinate, f"[drive.{name}]")
            changes[label(joint, scene.joint[joint].type, k)] = grown[name]
    return changes


def _repeats(steps: list[Any], start: float, period: float, changes: Mapping[str, float]) -> bool:
    """Return True when an expression has the same values at all times of a period and a period later.

    changes: of the driven coordinates that it may read, over the period.
    """
    random, given = np.random.default_rng(0), dict[Any, np.ndarray]()
    times = np.tile(start + period * np.arange(TIMES) / TIMES, MOTIONS)[:, None]

    def read(one: Any, later: float) -> np.ndarray:
        if _is_time(one):
            return times + later * period
        if one not in given:
            shape = (MOTIONS, 1, 3 if one.dim else 1)
            some = random.choice([-1.0, 1.0], shape) * 10.0 ** random.uniform(*SIZES, shape)
            given[one] = np.repeat(some, TIMES, axis=1).reshape(len(times), -1)
        grows = isinstance(one, Quantity) and one.kind == "joint_position"
        return given[one] + later * (changes.get(one.owner, 0.0) if grows else 0.0)

    # a table repeats where what it is over does: at random sizes, outside of the table, its sum stands for it
    sums = (["+"] * (len(step.of) - 1) if isinstance(step, Lookup) else [step] for step in steps)
    steps = [step for some in sums for step in some]
    with np.errstate(all="ignore"):  # powers of negative numbers
        both = [evaluate_postfix(steps, partial(read, later=later)) for later in (0.0, 1.0)]
        now, then = (np.broadcast_to(v, (len(times), v.shape[1])).reshape(MOTIONS, TIMES, -1) for v in both)
        size = np.fmax.reduce(np.abs(now), axis=1, keepdims=True)
        return not bool(np.any(np.abs(then - now) > EQUAL * size))

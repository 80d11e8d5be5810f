"""Contacts of loose bodies, between events that SciPy locates: the first impacts of a scene, found a second time."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from tests.reference.contact_solutions import modified_coulomb
from tests.reference.loose_bodies import SIZE, Array, Frame, LooseBodies, cross, read, si

#: factor a of F = K d^n (1 + a d'/d'0) for a coefficient of restitution c
FACTORS: dict[str, Callable[[float], float]] = {
    "lankarani-nikravesh": lambda c: 0.75 * (1.0 - c * c),
    "hunt-crossley": lambda c: 1.5 * (1.0 - c),
    "flores": lambda c: 8.0 * (1.0 - c) / (5.0 * c),
    "gonthier": lambda c: (1.0 - c * c) / c,
}


@dataclass(frozen=True)
class Impact:
    """Contact, times [s] and speeds [m/s] of its begin and end; the end is NaN where the run ends before."""

    contact: str
    start: float
    approach: float
    end: float = math.nan
    separation: float = math.nan


@dataclass(frozen=True)
class Touch:
    """Geometry of a contact: gap, rate of penetration, normal from outer to inner, centre distance and its rate."""

    gap: float
    rate: float
    normal: Array
    distance: float
    velocity: Array


class Contact:
    """A clearance joint of a scene."""

    def __init__(self, name: str, joint: dict[str, Any], frames: dict[str, Frame], place: int) -> None:
        self.name, self.planar, self.friction = name, "revolute" in joint["type"], joint.get("friction")
        self.outer, self.inner = (frames[f] for f in joint["between"])
        self.clearance = si(joint["clearance"])
        self.radius = si(joint["pin_radius"] if self.planar else joint["ball_radius"])
        law = joint["normal"]
        self.damping, self.factor = si(law.get("damping", 0.0)), 0.0
        self.exponent = 1.0 if law["law"] == "kelvin-voigt" else 1.5
        if law["law"] in FACTORS:
            self.factor = FACTORS[law["law"]](law["restitution"])
        self.stiffness = si(law["stiffness"]) if "stiffness" in law else self.hertz(joint)
        self.bristle = place  # where the deflection of LuGre's bristles stands in the state

    def hertz(self, joint: dict[str, Any]) -> float:
        """Eq. (26) of Wang & Wang (2019)."""
        names = ("journal_material", "pin_material") if self.planar else ("socket_material", "ball_material")
        materials = [joint[name] for name in names]
        h = sum((1.0 - m["poisson"] ** 2) / si(m["youngs_modulus"]) for m in materials)
        R, r = self.radius + self.clearance, self.radius
        return 4.0 / (3.0 * h) * math.sqrt(R * r / (R - r))

    def touch(self, mechanism: LooseBodies, y: Array) -> Touch:
        """Where the surfaces are."""
        outer, inner = mechanism.place(y, self.outer), mechanism.place(y, self.inner)
        d = inner.origin - outer.origin
        v = inner.velocity - outer.velocity - cross(outer.omega, d)
        if self.planar:
            z = outer.axes[:, 2]
            d, v = d - (z @ d) * z, v - (z @ v) * z
        distance = math.sqrt(d @ d)
        normal = d / distance if distance > 0.0 else np.array([0.0, 0.0, 1.0])
        return Touch(self.clearance - distance, float(normal @ v), normal, distance, v)

    def push(self, mechanism: LooseBodies, y: Array, impact_rate: float, out: Array) -> list[tuple[int, Array, Array]]:
        """Forces on both bodies while the contact lasts; writes the rate of the bristles into `out`."""
        t = self.touch(mechanism, y)
        outer, inner = mechanism.place(y, self.outer), mechanism.place(y, self.inner)
        depth = max(0.0, -t.gap)
        elastic = self.stiffness * depth**self.exponent
        pressed = max(0.0, elastic * (1.0 + self.factor * t.rate / max(impact_rate, 1e-6)) + self.damping * t.rate)
        Q = inner.origin + self.radius * t.normal
        slip = inner.velocity_at(Q) - outer.velocity_at(Q)
        slip = slip - (t.normal @ slip) * t.normal
        force = -pressed * t.normal
        if self.friction is not None and self.friction["law"] == "lugre":
            place = slice(self.bristle, self.bristle + 3)
            z = outer.axes @ y[place]
            z = z - (t.normal @ z) * t.normal
            pull, z_rate = bristles(self.friction, z, slip)
            force = force - pressed * pull
            # the deflection stays in the tangent plane, whose normal turns as seen from the outer body
            turning = (t.velocity - t.rate * t.normal) / t.distance
            z_rate = z_rate - (t.normal @ z_rate) * t.normal - (turning @ z) * t.normal
            out[place] = outer.axes.T @ z_rate
        elif self.friction is not None and slip @ slip > 0.0:
            speed = math.sqrt(slip @ slip)
            force = force - pressed * coefficient(self.friction, speed) * slip / speed
        return [(inner.body, Q, force), (outer.body, Q, -force)]


def coefficient(law: dict[str, Any], speed: float) -> float:
    """The paper's modified Coulomb friction, or Ambrosio's ramp."""
    if law["law"] == "ambrosio":
        low, high = si(law["v0"]), si(law["v1"])
        return law["dynamic"] * min(1.0, max(0.0, (speed - low) / (high - low)))
    return modified_coulomb(speed, law["static"], law["dynamic"], si(law["v_static"]), si(law["v_dynamic"]))


def bristles(law: dict[str, Any], z: Array, slip: Array) -> tuple[Array, Array]:
    """LuGre's force over the normal force, against the sliding, and the rate of z; damping as far as mu_s allows."""
    static, dynamic, stiffness = law["static"], law["dynamic"], law["bristle_stiffness"]
    speed = math.sqrt(slip @ slip)
    fading = math.exp(-((speed / si(law["v_stribeck"])) ** 2))
    rate = slip - stiffness * speed / (dynamic + (static - dynamic) * fading) * z
    elastic = stiffness * z
    damping = law.get("bristle_damping", 0.0) * fading * rate + law.get("viscous", 0.0) * slip
    low, high = 0.0, 1.0
    if np.linalg.norm(elastic + damping) > static:
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if np.linalg.norm(elastic + middle * damping) <= static else (low, middle)
    return elastic + high * damping, rate


def simulate(path: Path, end: float, count: int, rtol: float = 1e-11) -> list[Impact]:
    """The first `count` contacts of a scene that end before `end` [s], in the order of their begins."""
    scene = read(path)
    mechanism = LooseBodies(scene)
    first = SIZE * len(mechanism.bodies)
    joints = [(n, j) for n, j in scene["joint"].items() if "clearance" in j["type"]]
    contacts = [Contact(n, j, mechanism.frames, first + 3 * k) for k, (n, j) in enumerate(joints)]
    y, t = np.concatenate([mechanism.start(), np.zeros(3 * len(contacts))]), 0.0
    closed: dict[str, float] = {}
    found: list[Impact] = []

    def rhs(_: float, y: Array) -> Array:
        out = np.zeros_like(y)
        pushes = [p for c in contacts if c.name in closed for p in c.push(mechanism, y, closed[c.name], out)]
        out[:first] = mechanism.rates(y[:first], pushes)
        return out

    def gap_of(contact: Contact) -> Callable[[float, Array], float]:
        def gap(_: float, y: Array) -> float:
            return contact.touch(mechanism, y).gap

        gap.terminal, gap.direction = True, 1.0 if contact.name in closed else -1.0  # type: ignore[attr-defined]
        return gap

    while sum(not math.isnan(i.end) for i in found) < count:
        # steps short enough for no contact to begin and end in one
        longest = end / (2000.0 if closed else 200.0)
        tight = {"rtol": rtol, "atol": 1e-14, "max_step": longest}
        run = solve_ivp(rhs, (t, end), y, "DOP853", events=[gap_of(c) for c in contacts], **tight)
        t, y = float(run.t[-1]), run.y[:, -1]
        if run.status != 1:
            break
        for contact, times in zip(contacts, run.t_events, strict=True):
            if len(times):
                _switch(contact, contact.touch(mechanism, y).rate, t, closed, found)
                y[contact.bristle : contact.bristle + 3] = 0.0
    return found


def _switch(contact: Contact, rate: float, t: float, closed: dict[str, float], found: list[Impact]) -> None:
    """A contact begins, with this impact rate, or ends."""
    if contact.name not in closed:
        closed[contact.name] = max(rate, 0.0)
        found.append(Impact(contact.name, t, rate))
        return
    del closed[contact.name]
    k = max(i for i, impact in enumerate(found) if impact.contact == contact.name)
    found[k] = Impact(contact.name, found[k].start, found[k].approach, t, -rate)

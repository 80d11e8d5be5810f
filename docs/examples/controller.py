"""A cart balances a pole: state feedback in Python, sampled every 5 ms, pushes the cart.

The gains give the linear model the poles -2, -2, -6 and -6 1/s; the engine's cart and pole are not linear, and the
force is held between samples.
"""

import tomllib

import flexclear as fc

SCENE = """
title = "A cart balances a pole"
time.end = "8 s"
body.ground = { type = "ground", frames.rail = { rotation_vector = [0, "90 deg", 0] } }
joint.rail = { type = "prismatic", between = ["ground.rail", "cart.rail"] }
joint.pin = { type = "revolute", between = ["cart.pin", "pole.pin"] }
load.gravity = { type = "gravity", acceleration = [0, -9.81, 0] }
load.motor = { type = "joint-force", joint = "rail", force = 0 }
start.joint.pin.position = "10 deg"

[body.cart]
type = "rigid"
mass = "1 kg"
inertia = [0.01, 0.01, 0.01]
frames.rail = { rotation_vector = [0, "90 deg", 0] }
frames.pin = {}

[body.pole]
type = "rigid"
mass = "200 g"
com = [0, 0.3, 0]
inertia = [0.006, 1e-5, 0.006]
frames.pin = {}
"""
#: force per position, speed, angle and its rate of the cart and the pole
GAINS = 6.165, 8.220, -51.198, -10.008


def balanced(period: float = 5e-3) -> tuple[float, float]:
    """Return where cart [m] and pole [rad] are at the end."""
    names = "rail.position", "rail.velocity", "pin.position", "pin.velocity"
    with fc.simulation(fc.load_scene(tomllib.loads(SCENE))) as sim:
        for _ in range(round(8.0 / period)):
            sim.inputs["load.motor"] = sum(k * sim.read(name) for k, name in zip(GAINS, names, strict=True))
            sim.advance(period)
        return sim.read("rail.position"), sim.read("pin.position")


if __name__ == "__main__":
    print("cart {:.5f} m, pole {:.5f} rad".format(*balanced()))

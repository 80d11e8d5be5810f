"""A clearance joint as Exudyn's own contact object."""

from __future__ import annotations

from typing import Any

from pipeline.core.scene.clearance import ClearanceSpherical
from pipeline.dynamics.contact.surfaces import BallInSocket


def add(system: Any, parts: Any, joint: ClearanceSpherical, socket: Any, ball: Any) -> None:
    """Exudyn's contact of a ball in a hollow sphere, between markers; ValueError for laws that it does not have."""
    restitution = joint.normal.restitution
    if joint.normal.law != "lankarani-nikravesh" or restitution is None:
        raise ValueError(f"no Exudyn object has the normal law '{joint.normal.law}'")
    dynamic, linear_up_to = _friction(joint)
    exponent = joint.normal.exponent or 1.5
    data = system.AddNode(
        parts.NodeGenericData(initialCoordinates=[joint.clearance, 0.0, 0.0, 0.0], numberOfDataCoordinates=4)
    )
    system.AddObject(
        parts.ObjectContactSphereSphere(
            markerNumbers=[ball, socket],
            nodeNumber=data,
            spheresRadii=[joint.ball_radius, joint.ball_radius + joint.clearance],
            isHollowSphere1=True,
            impactModel=1,
            contactStiffness=BallInSocket.stiffness(joint, exponent),
            contactStiffnessExponent=exponent,
            restitutionCoefficient=1.0 - 0.5 * (1.0 - restitution**2),
            minimumImpactVelocity=joint.floor,
            dynamicFriction=dynamic,
            frictionProportionalZone=linear_up_to,
        )
    )


def _friction(joint: ClearanceSpherical) -> tuple[float, float]:
    """Coefficient, and the speed [m/s] up to which Exudyn's law rises to it."""
    law = joint.friction
    if law is None:
        return 0.0, 1e-3
    if law.law == "ambrosio" and law.v0 == 0.0:
        return law.dynamic, law.v1
    if law.law != "modified-coulomb":
        raise ValueError(f"no Exudyn object has the friction law '{law.law}'")
    # the slope of mu at rest is 3/2 mu_s / v_s here and mu_d / v there
    return law.dynamic, law.dynamic * law.v_static / (1.5 * law.static)

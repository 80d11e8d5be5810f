"""Hertzian stiffness of a ball in a socket."""

from __future__ import annotations

import math

from pipeline.core.scene.parts import ClearanceSpherical


def sphere_in_sphere(joint: ClearanceSpherical) -> float:
    r"""Generalised stiffness K [N/m^1.5] of a ball in a socket from radii and materials.

    .. math:: K = \frac{4}{3\pi(\sigma_i+\sigma_j)}\sqrt{\frac{R_iR_j}{R_i-R_j}}, \quad
              \sigma = \frac{1-\nu^2}{\pi E}

    Source: Wang & Wang (2019), eq. (26).
    """
    if joint.normal.stiffness is not None:
        return joint.normal.stiffness
    ball, socket = joint.ball_radius, joint.ball_radius + joint.clearance
    sigma = sum(
        (1.0 - material.poisson**2) / (math.pi * material.youngs_modulus)
        for material in (joint.socket_material, joint.ball_material)
        if material is not None
    )
    return 4.0 / (3.0 * math.pi * sigma) * math.sqrt(socket * ball / joint.clearance)

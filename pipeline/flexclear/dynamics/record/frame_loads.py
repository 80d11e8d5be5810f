"""Loads on the frames of flexible bodies, and the acceleration field of these bodies, in body axes."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.equations.observation import Series
from flexclear.dynamics.record.motion import Motions
from flexclear.dynamics.record.stress import motion_and_loads, on_displaced_frames


def record(motions: Motions, names: tuple[str, ...]) -> Series:
    """Return wrenches on the frames of the bodies `names`, and the motion of their axes: variables and coordinates."""
    wrenches, moved, frames = [], [], list[str]()
    for name in names:
        bundle = motions.model.links[motions.model.mechanism.link_of[name]].bundle
        assert bundle is not None
        motion, moment, force = motion_and_loads(motions, name)
        wrenches.append(on_displaced_frames(bundle, motion, moment, force))
        moved.append((motion.a, motion.omega, motion.alpha))
        frames += [f"{name}.{frame}" for frame in bundle["frame"].values]
    loads, dims = np.concatenate(wrenches, axis=1), ("time", "loaded_body", "axis")
    fields = ("origin_acceleration", "axes_velocity", "axes_acceleration")
    return {
        "frame_force": (("time", "loaded_frame", "axis"), loads[..., :3]),
        "frame_moment": (("time", "loaded_frame", "axis"), loads[..., 3:]),
        **{field: (dims, np.stack([one[k] for one in moved], axis=1)) for k, field in enumerate(fields)},
    }, {"loaded_frame": frames, "loaded_body": list(names)}

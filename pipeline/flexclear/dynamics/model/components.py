"""Independent mechanisms of a scene: no joint, contact, load or gear acts between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flexclear.scene.schema import Scene

#: one number per independent mechanism
Floors = Sequence[float] | np.ndarray
#: an error group: floor, number of variables, independent mechanism
Group = tuple[float, int, int]


@dataclass(frozen=True)
class Components:
    """Independent mechanisms of a scene, in the order of their first links.

    of_link: index of the mechanism of each link, -1 for the ground.  frames: of each mechanism, those that its joints,
    loads and paths name.  lengths: sizes [m].
    """

    of_link: tuple[int, ...]
    frames: tuple[frozenset[str], ...] = ()
    lengths: tuple[float, ...] = ()

    def of(self, *links: int) -> int:
        """Return the independent mechanism of a part between some links, one of which may be the ground."""
        return max([0, *(self.of_link[link] for link in links)])


def coupled_frames(scene: Scene) -> list[tuple[str, ...]]:
    """Return the frames between which each part of a scene acts: joints, loads, gears, stops and paths."""

    def of_joints(*names: str) -> tuple[str, ...]:
        return tuple(frame for name in names if name in scene.joint for frame in scene.joint[name].between)

    parts = [tuple(joint.between) for joint in scene.joint.values()]
    others: list[object] = [*scene.load.values(), *scene.drive.values()]
    for part in others:
        measured, frame = getattr(part, "measured", None) or "", getattr(part, "frame", None)
        at = getattr(part, "between", None) or ([frame] if frame else [])
        parts.append((*at, *of_joints(getattr(part, "joint", ""), measured.partition(".")[0])))
    pairs = [(gear.first, gear.second) for gear in scene.gear.values()]
    pairs += [(stop.joint, stop.relative_to) for stop in scene.stop.values() if stop.relative_to is not None]
    parts += [of_joints(*(text.partition(".")[0] for text in pair)) for pair in pairs]
    return parts


def components(scene: Scene, parents: Sequence[int], link_of: Mapping[str, int]) -> Components:
    """Return the independent mechanisms, without their sizes.

    parents: of each link in the tree, -1 for the ground.  link_of: the link of each body.
    """
    root = list(range(len(parents)))

    def find(link: int) -> int:
        while root[link] != link:
            link = root[link]
        return link

    parts = coupled_frames(scene)
    held = [[link_of[b] for f in part if (b := f.partition(".")[0]) in link_of] for part in parts]
    for links in [*held, *([i, parent] for i, parent in enumerate(parents))]:
        moving = [find(link) for link in links if link > 0]
        for link in moving:
            root[find(link)] = find(moving[0])
    first = dict.fromkeys(find(link) for link in range(1, len(parents)))
    numbers = {link: k for k, link in enumerate(first)}
    result = Components((-1, *(numbers[find(link)] for link in range(1, len(parents)))))
    frames = [set[str]() for _ in numbers] or [set[str]()]
    for part, links in zip(parts, held, strict=True):
        if any(links):
            frames[result.of(*links)].update(part)
    return Components(result.of_link, tuple(map(frozenset, frames)))

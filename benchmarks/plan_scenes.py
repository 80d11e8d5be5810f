"""Random scenes for the benchmark of plans: four mechanisms with random clearances, rods, speeds and accuracies.

One seed defines one family of scenes. Every scene may have all effects: flexible rods, clearances with friction,
gravity, damping. Ranges: clearances from 1 um to 1 mm, rods from steel to nylon, speeds from a tenth to ten times the
usual ones, and accuracies over four decades: 1 um to 10 mm, 10 urad to 0.1 rad, 0.1 mm/s to 1 m/s, fractions of forces.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flexclear.artifacts.paths import PROJECT
from flexclear.commands.new import TEMPLATES
from flexclear.scene.load import edited, load_scene
from flexclear.scene.schema import Scene

#: density [kg/m^3], Young's modulus [Pa], Poisson's ratio
MATERIALS = {
    "steel": (7850.0, 207e9, 0.29),
    "titanium": (4430.0, 114e9, 0.34),
    "aluminium": (2740.0, 71.7e9, 0.33),
    "magnesium": (1740.0, 45e9, 0.35),
    "nylon": (1140.0, 2.7e9, 0.39),
}
CLEARANCES, SPEEDS = (1e-6, 1e-3), (0.1, 10.0)
#: accuracies over four decades, by quantity [SI]; those of forces and contact quantities (FORCES) are relative
ACCURACIES = {
    "position": (1e-6, 1e-2),
    "orientation": (1e-5, 1e-1),
    "velocity": (1e-4, 1.0),
    "angular_velocity": (1e-3, 10.0),
}
FORCES = (5e-5, 5e-1)
#: probability of each kind of requested quantity
ASKED = {"pose": 0.5, "pose and rate": 0.2, "rate": 0.1, "force": 0.2}


@dataclass(frozen=True)
class Mechanism:
    """Data of one mechanism.

    source: scene file.  loose: joint with clearance.  rods: recipe of each flexible body.  quantities: by kind.  more:
    function that changes the scene further.
    """

    source: Path
    loose: str
    rods: Mapping[str, Path]
    quantities: Mapping[str, tuple[str, ...]]
    more: Callable[[dict[str, Any], np.random.Generator], None] | None = None


def _second_leg(table: dict[str, Any], random: np.random.Generator) -> None:
    """Add a second clearance joint, A3 on the other side, to half of the platforms."""
    if random.random() < 0.5:
        table["joint.A3"] = {**table["joint.A1"], "between": ["socket_A3.centre", "ball_A3.centre"]}


def _bent_coupler(table: dict[str, Any], random: np.random.Generator) -> None:
    """Replace the coupler of the four-bar by a beam that starts at pin B."""
    table["body.coupler"] = {
        "type": "flexible",
        "modes": {"reference": "craig-bampton", "count": 13, "interfaces": ["B", "C"]},
        "damping": 0.01,
        "pose": {"position": [0.1, 0.0, 0.0], "rotation_vector": [0.0, 0.0, 0.7227342478134157]},
    }


SCENES = PROJECT / "scenes"
MECHANISMS = {
    "sps4": Mechanism(
        SCENES / "sps4" / "far_csj_cb.toml",
        "A1",
        {"rod1": PROJECT / "meshes" / "actuated_rod.toml"},
        {
            "pose": ("platform.position", "platform.orientation"),
            "rate": ("platform.velocity", "platform.angular_velocity"),
            "force": ("A2.force", "C.force", "A1.peak_force"),
        },
        _second_leg,
    ),
    "slider-crank": Mechanism(
        TEMPLATES / "slider_crank" / "slider_crank.toml",
        "pin",
        {"rod": TEMPLATES / "slider_crank" / "rod.toml"},
        {"pose": ("slider.position",), "rate": ("slider.velocity",), "force": ("wrist.force", "pin.peak_force")},
    ),
    "four-bar": Mechanism(
        TEMPLATES / "four_bar" / "four_bar.toml",
        "C",
        {"coupler": TEMPLATES / "slider_crank" / "rod.toml"},
        {
            "pose": ("rocker.position", "rocker.orientation"),
            "rate": ("rocker.angular_velocity",),
            "force": ("D.force", "C.peak_force"),
        },
        _bent_coupler,
    ),
    "leg": Mechanism(
        TEMPLATES / "leg" / "leg.toml",
        "ball",
        {"rod": TEMPLATES / "leg" / "leg_rod.toml"},
        {"pose": ("platform.position",), "rate": ("platform.velocity",), "force": ("slide.force", "ball.peak_force")},
    ),
}
#: limit of evaluations of a full run, above which a scene leaves the family: with three members, about a minute
DEAREST = 5_000_000
#: longest duration of a scene, as a multiple of the mechanism's usual motion
LONGEST = 0.6
#: half of the scenes are the parallel mechanism of the paper
ORDER = ("sps4", "slider-crank", "sps4", "four-bar", "sps4", "leg")


@dataclass(frozen=True)
class Drawn:
    """A scene of the family and its random parameters."""

    scene: Scene
    record: Mapping[str, Any]


def drawn(seed: int, number: int, folder: Path) -> Drawn:
    """Return scene `number` of a seed's family; write the recipes of its rods into a folder."""
    random = np.random.default_rng([seed, number])
    name = ORDER[number % len(ORDER)]
    mechanism = MECHANISMS[name]
    speed = _log_uniform(random, *SPEEDS)
    clearance = _log_uniform(random, *CLEARANCES)
    material = list(MATERIALS)[random.integers(len(MATERIALS))]
    base = load_scene(mechanism.source)
    table: dict[str, Any] = {"accuracy": None, "ensemble": None, "view": None, "sections": None}
    table["solver"] = {"evaluations": DEAREST}
    table["output"] = {"interval": min(base.time.end / speed, LONGEST * base.time.end) / 600.0}
    # slow motions are simulated over their first part only
    table["time.end"] = min(base.time.end / speed, LONGEST * base.time.end)
    plain = base.model_dump(mode="json", exclude_none=True)
    for drive, part in plain["drive"].items():
        table[f"drive.{drive}"] = {**part, "law": _faster(part["law"], speed)}
    first = mechanism.loose
    table[f"joint.{first}"] = {**plain["joint"][first], "clearance": clearance}
    if mechanism.more is not None:
        mechanism.more(table, random)
    for body, recipe in mechanism.rods.items():
        flexible = table.get(f"body.{body}") or dict(plain["body"][body])
        flexible["mesh"] = str(_recipe(recipe, name, material, folder))
        flexible["modes"] = {**flexible["modes"], "interfaces": list(_ends(name))}
        damping = float(random.choice([0.0, 0.005, 0.02]))
        flexible.pop("damping", None)
        table[f"body.{body}"] = flexible | ({"damping": damping} if damping else {})
    down = [0.0, 0.0, -9.81] if name in ("sps4", "leg") else [0.0, -9.81, 0.0]
    loads = {key: load for key, load in plain.get("load", {}).items() if key != "gravity"}
    table["load"] = loads | ({"gravity": {"type": "gravity", "acceleration": down}} if random.random() < 0.5 else {})
    scene = edited(base, table)
    requested = _requested(random, mechanism)
    scene = edited(scene, {"accuracy": {"quantities": requested}})
    scene._name, scene._path = f"{name}-{number}", None
    record = {"mechanism": name, "clearance": clearance, "speed": speed, "rod": material, "wanted": requested}
    return Drawn(scene, record)


def _log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def _requested(random: np.random.Generator, mechanism: Mechanism) -> dict[str, dict[str, float]]:
    """Return random quantities with their requested accuracy, absolute or relative as in a scene."""
    kinds = str(random.choice(list(ASKED), p=list(ASKED.values()))).split(" and ")
    found = {}
    for kind in kinds:
        quantity = str(random.choice(mechanism.quantities[kind]))
        limits = ACCURACIES.get(quantity.rpartition(".")[2])
        found[quantity] = (
            {"absolute": _log_uniform(random, *limits)} if limits else {"relative": _log_uniform(random, *FORCES)}
        )
    return found


def _faster(law: dict[str, Any], speed: float) -> dict[str, Any]:
    """Return a step law with scaled times; a constant law stays unchanged."""
    return law | {k: (np.atleast_1d(law[k]) / speed).tolist() for k in ("start", "end") if k in law}


def _ends(name: str) -> tuple[str, str]:
    ends = {"slider-crank": ("big_end", "small_end"), "four-bar": ("B", "C")}
    return ends.get(name, ("bottom", "top"))


def _recipe(recipe: Path, name: str, material: str, folder: Path) -> Path:
    """Write the recipe of a rod of another material; that of the four-bar also gets its length and names of frames."""
    density, modulus, poisson = MATERIALS[material]
    text = recipe.read_text(encoding="utf-8")
    text = re.sub(r"(?m)^density = .*$", f"density = {density}", text)
    text = re.sub(r"(?m)^youngs_modulus = .*$", f"youngs_modulus = {modulus}", text)
    text = re.sub(r"(?m)^poisson = .*$", f"poisson = {poisson}", text)
    if name == "four-bar":
        text = text.replace("200 mm", "300 mm").replace("100 mm", "150 mm")
        text = text.replace("big_end", "B").replace("small_end", "C")
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / f"{name}-{material}.toml"
    target.write_text(text, encoding="utf-8", newline="\n")
    return target

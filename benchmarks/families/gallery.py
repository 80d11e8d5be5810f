"""Gallery of mechanisms of many kinds, each with a question that a run of its scene answers, and a picture."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from benchmarks.family import Case, Family, Measured, Record
from benchmarks.page import DOCS
from flexclear import dynamics
from flexclear.dynamics import analyses
from flexclear.post.single_run.series import derive
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.stages import rendering
from flexclear.stages.scenes import bundles, find_scene
from flexclear.system.progress import silent

PICTURES = DOCS / "gallery"
#: pictures: size [pixels], factor of the size at which they are drawn first, and number of colours, for small files
WIDTH, HEIGHT, FINER, COLOURS = 640, 480, 2, 256
Bundles = Mapping[str, xr.Dataset]


@dataclass(frozen=True)
class Entry:
    """A mechanism of the gallery.

    answer: returns the answer to the question, in words with numbers, from a run and its scene.
    change: edits of the scene that shorten the run.  linear: the answer reads the vibrations instead of a run.
    moving: the vibrations are those of a steady motion.  at: time of the picture as a fraction of the run.
    """

    scene: str
    question: str
    answer: Callable[[xr.Dataset, Scene], str]
    change: Mapping[str, Any] = field(default_factory=dict)
    linear: bool = False
    moving: bool = False
    at: float = 0.35

    @property
    def name(self) -> str:
        """Last part of the scene's name."""
        return self.scene.rpartition("/")[2]


def _swing(angles: xr.DataArray) -> float:
    return np.degrees(float(angles.max() - angles.min()))


def _four_bar(run: xr.Dataset, scene: Scene) -> str:
    swing = _swing(run["joint_position"].sel(coordinate="D"))
    torque = derive(run)["peak_drive_force"].sel(drive="motor")
    return f"The rocker swings by {swing:.1f}°; the motor needs up to {float(torque):.3g} N m."


def _slider_crank(run: xr.Dataset, scene: Scene) -> str:
    post = derive(run)
    count, peak = int(post["impact_count"].sel(contact="pin")), float(post["peak_force"].sel(contact="pin"))
    return (
        f"The pin hits its journal {count} times in {1e3 * scene.time.end:.0f} ms, with up to {peak / 1e3:.2g} kN; "
        f"it is in contact for {100 * float(post['contact_time_share'].sel(contact='pin')):.0f} % of the time."
    )


def _bearing(run: xr.Dataset, scene: Scene) -> str:
    x, y, _ = run["contact_offset"].sel(contact="bearing").values[-1]
    thickness, torque = (run[f"film_{key}"].sel(film="bearing").values[-1] for key in ("thickness", "moment"))
    return (
        f"{1e3 * np.hypot(x, y):.2f} mm from the middle, {np.degrees(np.arctan2(x, -y)):.0f}° ahead of the load; the "
        f"film is {1e3 * thickness:.2f} mm thick there and brakes the shaft with {-1e3 * torque[2]:.0f} N mm."
    )


def _slider(run: xr.Dataset, scene: Scene) -> str:
    post = derive(run)
    tilt = 2e3 * np.abs(run["quaternion"].sel(body="slider").values[:, 3]).max()
    return (
        f"Its corners hit it {int(post['impact_count'].sum())} times in {1e3 * scene.time.end:.0f} ms, with up to "
        f"{float(post['peak_force'].max()):.3g} N; it tilts by up to {tilt:.2g} mrad."
    )


def _scott_russell(run: xr.Dataset, scene: Scene) -> str:
    point = run["frame_position"].sel(frame="rod.point")
    way = float(abs(point.sel(axis="y")[-1] - point.sel(axis="y")[0]))
    off = float(abs(point.sel(axis="x")).max())
    deviation = "less than 1e-12" if off < 1e-12 else f"{off:.0e}"
    return f"It travels {1e3 * way:.0f} mm and leaves the straight line by {deviation} m."


def _shear_pin(run: xr.Dataset, scene: Scene) -> str:
    broken, clamped = (float(run["event_time"][run["event_contact"] == name][0]) for name in ("break", "clamp"))
    way = float(run["joint_position"].sel(coordinate="guide")[-1])
    return (
        f"The pin breaks after {1e3 * broken:.1f} ms; the slider runs on for {1e3 * (clamped - broken):.2f} ms and "
        f"stops at {1e3 * way:.1f} mm."
    )


def _stewart(run: xr.Dataset, scene: Scene) -> str:
    forces = derive(run)["peak_drive_force"]
    lengths = run["joint_position"].isel(coordinate=run["coordinate_joint"].str.startswith("leg").values)
    stroke = float((lengths.max("time") - lengths.min("time")).max())
    hardest = float(forces.isel(drive=forces["drive"].str.startswith("leg").values).max())
    return f"The legs need a stroke of {1e3 * stroke:.0f} mm and push with up to {hardest:.0f} N."


def _robot_arm(run: xr.Dataset, scene: Scene) -> str:
    tip, seat = (run["frame_position"].sel(frame=f"arm.{end}") for end in ("tip", "seat"))
    way = (tip - seat).isel(time=(run["time"] > 0.4).values)
    angle = np.arctan2(way.sel(axis="y").values, way.sel(axis="x").values)
    return f"The tip swings on by ±{1e3 * 0.6 * 0.5 * float(np.ptp(angle)):.2g} mm about its new position."


def _universal(run: xr.Dataset, scene: Scene) -> str:
    speed = np.linalg.norm(run["angular_velocity"].sel(body="second").values, axis=1)
    first = np.linalg.norm(run["angular_velocity"].sel(body="first").values, axis=1)
    low, high = (speed / first).min(), (speed / first).max()
    return f"Its speed goes from {low:.3f} to {high:.3f} of the first one's (cos 30° and 1/cos 30°)."


def _top(run: xr.Dataset, scene: Scene) -> str:
    p = run["position"].sel(body="top").values
    turned = np.degrees(np.unwrap(np.arctan2(p[:, 1], p[:, 0])))
    nodding = np.degrees(np.ptp(np.arcsin(p[:, 2] / np.linalg.norm(p, axis=1))))
    rate = abs(turned[-1] - turned[0]) / (run["time"].values[-1] - run["time"].values[0])
    return f"It precesses at {rate:.0f}°/s on average and nods by {nodding:.2g}°."


def _governor(run: xr.Dataset, scene: Scene) -> str:
    lift = run["position"].sel(body="sleeve", axis="z")
    speed = run["joint_velocity"].sel(coordinate="spindle")[-1]
    return (
        f"After {scene.time.end:.0f} s it turns at {float(speed) * 30 / np.pi:.0f} rpm, "
        f"and the sleeve has risen by {1e3 * float(lift[-1] - lift[0]):.0f} mm."
    )


def _rotor(linear: xr.Dataset, scene: Scene) -> str:
    listed = ", ".join(f"{value:.1f}" for value in np.unique(linear["frequency"].values.round(1))[:4])
    return f"In the axes that turn with the shaft its lowest whirls have {listed} Hz."


def _bracket(linear: xr.Dataset, scene: Scene) -> str:
    found = linear["frequency"].values
    swing, bend = found[found > 0.0][:2]
    return f"It swings at {swing:.2f} Hz; its first vibration of the metal has {bend:.0f} Hz."


def _meshed_rod(run: xr.Dataset, scene: Scene) -> str:
    angle, place = run["joint_position"].sel(coordinate="main"), run["position"].sel(body="piston", axis="x")
    ideal = 0.04 * np.cos(angle) + np.sqrt(0.16**2 - (0.04 * np.sin(angle)) ** 2)
    force = np.linalg.norm(run["joint_force"].sel(joint="wrist"), axis=1).max()
    off = 1e6 * float(abs(place - ideal).max())
    return f"Up to {force:.0f} N go through the rod, and the piston is up to {off:.0f} µm off."


def _bricard(run: xr.Dataset, scene: Scene) -> str:
    return (
        f"It has {int(run['mobility'][0])} freedom, though counting joints leaves none; "
        f"{run.attrs['redundant_closure_rows']} closure equation is redundant."
    )


def _squeezer(run: xr.Dataset, scene: Scene) -> str:
    angle = run["joint_position"].sel(coordinate="O")
    return f"The crank turns {float(angle[-1] - angle[0]) / (2 * np.pi):.1f} times in {1e3 * scene.time.end:.0f} ms."


def _gears(run: xr.Dataset, scene: Scene) -> str:
    sun, carrier = (run["angular_velocity"].sel(body=name, axis="z")[-1] for name in ("sun", "carrier"))
    return f"The sun turns {float(sun / carrier):.3f} times as fast as the carrier, as Willis' equation says."


def _yoke(run: xr.Dataset, scene: Scene) -> str:
    post = derive(run)
    return f"The pin hits the slot's walls {int(post['impact_count'].sel(contact='slot'))} times in half a second."


def _balls(run: xr.Dataset, scene: Scene) -> str:
    height = run["contact_gap"].sel(contact="floor")
    hits = int(derive(run)["impact_count"].sel(contact="floor"))
    return f"Dropped from {1e3 * float(height[0]):.0f} mm it bounces {hits} times."


def _bushing(run: xr.Dataset, scene: Scene) -> str:
    moved = np.linalg.norm(run["bushing_displacement"].values, axis=-1)
    return f"It gives by up to {1e3 * moved.max():.1f} mm."


def _bifilar(run: xr.Dataset, scene: Scene) -> str:
    force = derive(run)["peak_reaction"].sel(joint="hook_left")
    return f"Each rod carries up to {float(force):.1f} N."


def _six_bar(run: xr.Dataset, scene: Scene) -> str:
    swing = _swing(run["joint_position"].sel(coordinate="O3"))
    torque = derive(run)["peak_drive_force"].sel(drive="motor")
    return f"It swings by {swing:.1f}°, and the motor supplies up to {float(torque):.2g} N m."


def _rssr(run: xr.Dataset, scene: Scene) -> str:
    swing = _swing(run["joint_position"].sel(coordinate="out"))
    peak = float(derive(run)["peak_force"].sel(contact="B"))
    return f"It swings by {swing:.1f}°; the ball presses on its socket with up to {peak:.0f} N."


def _arm(run: xr.Dataset, scene: Scene) -> str:
    held = run["controller_force"].isel(time=-1)
    shoulder, elbow = (float(held.sel(controller=f"{name}_motor")) for name in ("shoulder", "elbow"))
    return f"It gets there, and is held by {shoulder:.1f} N m at the shoulder and {elbow:.2f} N m at the elbow."


def _shaft(run: xr.Dataset, scene: Scene) -> str:
    speed, time = run["angular_velocity"].sel(body="disc", axis="z").values, run["time"].values
    wound = speed - np.polyval(np.polyfit(time, speed, 1), time)
    crossings = np.flatnonzero(np.diff(np.sign(wound)) > 0)
    period = (time[crossings[-1]] - time[crossings[0]]) / (len(crossings) - 1)
    return f"It winds up and down at {1.0 / period:.0f} Hz while it speeds up to {abs(speed[-1]):.0f} rad/s."


def _driven_yoke(run: xr.Dataset, scene: Scene) -> str:
    angle = run["joint_position"].sel(coordinate="O").values
    off = abs(run["position"].sel(body="yoke", axis="x").values - 0.05 * np.cos(angle)).max()
    peak = float(derive(run)["peak_force"].sel(contact="slot"))
    return f"It is off by up to {1e3 * off:.2f} mm, and the pin hits with up to {peak / 1e3:.1f} kN."


def _rolling(run: xr.Dataset, scene: Scene) -> str:
    moved = run["position"].sel(body="ball").isel(time=-1) - run["position"].sel(body="ball").isel(time=0)
    turned = float(run["angular_velocity"].sel(body="ball", axis="y")[-1]) * scene.contacts()["floor"].radius
    slip = 1.0 - turned / float(np.linalg.norm(run["velocity"].sel(body="ball").values[-1]))
    return f"It gets {float(np.linalg.norm(moved)):.2f} m far; it slips by {100 * abs(slip):.2g} %."


def _cam(run: xr.Dataset, scene: Scene) -> str:
    late = run.isel(time=(run["time"] >= 0.2).values)
    torque, press = abs(late["drive_force"]).max(), late["load_force"].sel(load="contact", axis="z")
    profile = 0.01 * (1.0 - np.cos(late["joint_position"].sel(coordinate="shaft")))
    off = abs(late["joint_position"].sel(coordinate="rail") - profile).max()
    return (
        f"Up to {float(torque):.2g} N m; the contact carries {float(press.min()):.2g} to {float(press.max()):.2g} N, "
        f"and the follower stays within {1e6 * float(off):.2g} µm of the profile."
    )


def _backlash(run: xr.Dataset, scene: Scene) -> str:
    late = run["joint_position"].isel(time=(run["time"] >= 1.0).values)
    pinion, wheel = (_swing(late.sel(coordinate=name)) for name in ("pinion", "wheel"))
    return f"The wheel swings by {wheel:.2f}°, {pinion / 3.0 - wheel:.2f}° less than the teeth's ratio gives."


def _worn_crank(run: xr.Dataset, scene: Scene) -> str:
    post = derive(run)
    depth = np.sort(post["wear_depth_outer"].sel(worn="pin").values[0])[::-1]
    most = 100.0 * depth[: len(depth) // 4].sum() / depth.sum()
    volume = float(post["wear_volume"].sel(worn="pin"))
    return f"A million turns would wear {1e15 * volume:.0f} mm³, {most:.0f} % of it in a quarter of the journal."


def _controllers(run: xr.Dataset, scene: Scene) -> str:
    push = abs(run["controller_force"]).max("time")
    return f"The hardest push is {float(push.max()):.3g} N, by '{push.idxmax().item()}'."


def _paper(run: xr.Dataset, scene: Scene) -> str:
    post = derive(run)
    return (
        f"Ball and socket meet {int(post['impact_count'].sel(contact='A1'))} times in the first "
        f"{1e3 * scene.time.end:.0f} ms, with up to {float(post['peak_force'].sel(contact='A1')):.0f} N."
    )


ENTRIES = {
    entry.name: entry
    for entry in (
        Entry("gallery/four_bar", "How far does the rocker swing, and what must the motor supply?", _four_bar),
        Entry("checks/clearance_slider_crank", "What does 0.1 mm of clearance do at 5000 rpm?", _slider_crank),
        Entry("gallery/worn_crank", "Where does the crank pin wear its journal?", _worn_crank),
        Entry("gallery/scott_russell", "How straight is its straight line?", _scott_russell),
        Entry("gallery/six_bar", "How far does a rocker swing that a loose, bending link drives?", _six_bar),
        Entry("gallery/rssr", "How far does a rocker across the crank's axis swing?", _rssr),
        Entry("gallery/stewart", "Which stroke and force must the six legs have for this path?", _stewart, at=0.0),
        Entry(
            "gallery/shear_pin", "When does the shear pin break, and where does the slider stop?", _shear_pin, at=0.5
        ),
        Entry("gallery/robot_arm", "How much does the load swing after the arm has stopped?", _robot_arm),
        Entry("gallery/pid_arm", "Which torques hold the arm where its controllers have moved it?", _arm),
        Entry("checks/universal_shaft", "How unevenly does the second shaft turn?", _universal),
        Entry("checks/heavy_top", "How does a fast top move that leans to its side?", _top, {"time.end": "0.3 s"}),
        Entry("checks/governor", "At which speed does it settle, and how high is the sleeve?", _governor),
        Entry("checks/overhung_rotor", "Which whirls has a disc on a turning shaft?", _rotor, linear=True, moving=True),
        Entry("gallery/bracket", "Which frequencies has a part meshed with Gmsh on its pin?", _bracket, linear=True),
        Entry("gallery/meshed_rod", "What do a loose pin and a meshed rod do to a piston?", _meshed_rod),
        Entry("checks/bricard", "How many freedoms has it?", _bricard, {"time.end": "1 s"}),
        Entry("checks/andrews_squeezer", "How fast does the squeezer run away?", _squeezer),
        Entry("checks/gears", "Which ratio has the planetary train?", _gears, {"time.end": "0.2 s"}),
        Entry("gallery/gear_shaft", "At which frequency does a disc on a flexible shaft wind up and down?", _shaft),
        Entry("gallery/driven_yoke", "How far is the motion of a loose yoke off a cosine?", _driven_yoke),
        Entry("gallery/cam", "How hard must a motor turn a cam that lifts a spring-loaded follower?", _cam),
        Entry("gallery/backlash", "How much of a swing does the backlash of a gear pair take?", _backlash),
        Entry("checks/scotch_yoke", "How often does a loose pin hit its slot?", _yoke),
        Entry("gallery/loose_slider", "How does a slider hit its guide that is 1 mm too wide on each side?", _slider),
        Entry("gallery/journal_bearing", "Where does a turning shaft come to rest in its oil?", _bearing, at=1.0),
        Entry("checks/ball_on_plane", "How often does a ball bounce in half a second?", _balls),
        Entry("gallery/rolling_ball", "How far does a ball roll down a slope in a second?", _rolling, at=1.0),
        Entry("checks/bushing", "How far does a block move on its rubber mount?", _bushing),
        Entry("checks/bifilar_pendulum", "What do the rods of a hanging bar carry?", _bifilar),
        Entry("checks/controllers", "How hard do the controllers push?", _controllers),
        Entry("sps4/csj", "What happens in the paper's loose ball joint?", _paper, {"time.end": "20 ms"}),
    )
}


def cases() -> list[Case]:
    """Return a case for each entry."""
    return [Case(name) for name in ENTRIES]


def scene_of(entry: Entry) -> Scene:
    """Return the scene of an entry, with its changes."""
    return load_scene(find_scene(entry.scene), entry.change)


def solved(entry: Entry, scene: Scene, reduced: Bundles) -> xr.Dataset:
    """Return the dataset from which an entry's answer is read."""
    if entry.linear:
        return analyses.frequencies(scene, reduced, silent, moving=entry.moving)
    return dynamics.simulate(scene, reduced, silent)


def measure(chosen: Sequence[Case], jobs: int) -> Measured:
    """Yield question, answer and warm time of one run; store the picture next to the page."""
    PICTURES.mkdir(exist_ok=True)
    for case in chosen:
        entry = ENTRIES[case.name]
        scene = scene_of(entry)
        reduced = bundles(scene)
        found = solved(entry, scene, reduced)  # a first run, which compiles
        begun = time.perf_counter()
        found = solved(entry, scene, reduced)
        seconds = time.perf_counter() - begun
        _draw(entry, scene, reduced, dynamics.simulate(scene, reduced, silent) if entry.linear else found)
        record: Record = {"scene": entry.scene, "title": scene.title, "question": entry.question}
        yield case, [{**record, "answer": entry.answer(found, scene), "seconds": seconds, "parts": scene.summary()}]


def _draw(entry: Entry, scene: Scene, reduced: Bundles, run: xr.Dataset) -> None:
    """Write the picture of a run, where this machine can draw."""
    from flexclear.post.render import gl

    if not gl.can_draw():
        return
    from PIL import Image

    from flexclear.post.render import film, mechanism, ruler

    params = rendering.params(scene, "motion", "html")
    looks = mechanism.Looks(bodies=params["bodies"], **params.get("view", {}))
    drawn = mechanism.mechanism(run, reduced, looks)
    row = round(entry.at * (run.sizes["time"] - 1))
    large = Image.fromarray(film.still(drawn, row, (FINER * WIDTH, FINER * HEIGHT)))
    small = np.asarray(large.resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS))
    noted = Image.fromarray(ruler.with_scale_bar(small, drawn))
    noted.quantize(COLOURS).save(PICTURES / f"{entry.name}.png", optimize=True)


def show(records: list[Record]) -> str:
    """Return a paragraph and a picture for each record."""
    parts = []
    for record in records:
        name = record["case"]
        picture = f"![{name}](gallery/{name}.png)\n\n" if (PICTURES / f"{name}.png").is_file() else ""
        parts.append(
            f"## {record['title']}\n\n{picture}*{record['question']}* {record['answer']}\n\n"
            f"`scenes/{record['scene']}.toml`\n"
        )
    return "\n".join(parts)


FAMILY = Family(
    what="Mechanisms of many kinds: a question, what a run answers, a picture, and how long that takes.",
    takes="three minutes",
    page="gallery.md",
    cases=cases,
    measure=measure,
    show=show,
    times=False,
)

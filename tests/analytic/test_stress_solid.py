"""Stresses of solids: against scikit-fem with the same cells, closed forms, and the full model in motion."""

import base64
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg
import skfem
import xarray as xr
from skfem.models.elasticity import lame_parameters, linear_elasticity

import flexclear as fc
import flexclear.artifacts.compliance
from flexclear.numerics.rotations import components, matrices, principal, von_mises
from flexclear.post import body_shape
from flexclear.post.render import player
from flexclear.post.render.mechanism import mechanism
from flexclear.post.single_run.series import derive
from flexclear.scene.load import load_scene
from flexclear.structure.fe.solid.elements import ELEMENTS
from flexclear.structure.fe.solid.model import solid_of, unknowns_of
from flexclear.structure.kinds.kind import of_mesh
from flexclear.structure.stress.solid import at_nodes
from flexclear.system.errors import FlexclearError
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import bundles, run_with_sections
from tests.analytic.solid_models import ALUMINIUM, block, build

SIZE = (0.1, 0.02, 0.01)
RHO = ALUMINIUM["density"]
#: small, since the run has the levers of the deformed part: these differ by 3e-5 at a hundred thousand times the force
FORCE = [1.2e-3, 4e-4, -2.5e-4]
CB = {"reference": "craig-bampton", "count": 13}
#: nothing moves, so that the energies that are exchanged are rounding
STILL = {"start": {"at": "equilibrium"}, "time": {"end": 1e-4}, "solver": {"ledger_tolerance": 0.1}}


def toml(value: Any) -> str:
    """A value as an inline table, list or number of TOML."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {toml(v)}" for k, v in value.items()) + " }"
    return f"[{', '.join(map(toml, value))}]" if isinstance(value, list | tuple) else json.dumps(value)


def written(folder: Path, name: str, table: dict[str, Any]) -> Path:
    """A file of TOML."""
    path = folder / name
    path.write_text("\n".join(f"{key} = {toml(value)}" for key, value in table.items()))
    return path


def cantilever(folder: Path, recipe: dict[str, Any], modes: dict[str, Any], **more: Any) -> tuple[Any, xr.Dataset]:
    """Bundle and run of a part whose frame `bottom` is fixed to the ground; more: tables of the scene."""
    mesh = written(folder, "part.toml", recipe)
    table = {
        "title": "A part held at its foot",
        "time": {"end": 1e-3},
        "output": {"interval": 1e-4, "stress": ["part"]},
        "body": {
            "ground": {"type": "ground", "frames": {"wall": {}}},
            "part": {"type": "flexible", "mesh": str(mesh), "modes": modes},
        },
        "joint": {"clamp": {"type": "fixed", "between": ["ground.wall", "part.bottom"]}},
    }
    for key, value in more.items():
        table[key] = table.get(key, {}) | value
    scene = load_scene(written(folder, "scene.toml", table))
    from flexclear import dynamics

    made = bundles(scene)
    return made["part"], dynamics.simulate(scene, made, silent)


def everywhere(bundle: xr.Dataset, run: xr.Dataset, row: int) -> np.ndarray:
    """Stress of every drawn node at one time, shape (node, 6)."""
    return np.asarray(bundle["stress_field"].values @ run["stress_factor"].values[row])


def nodes_of(mesh: xr.Dataset, bundle: xr.Dataset) -> list[int]:
    """Nodes of the mesh that the bundle draws."""
    x = mesh["node_position"].values
    return [int(np.argmin(np.linalg.norm(x - point, axis=1))) for point in bundle["node_position"].values]


# Against scikit-fem -------------------------------------------------------------------------------------------------


#: scikit-fem's elements, by their names here
THEIRS = {
    "hex8": skfem.ElementHex1,
    "hex20": skfem.ElementHexS2,
    "hex27": skfem.ElementHex2,
    "tet4": skfem.ElementTetP1,
    "tet10": skfem.ElementTetP2,
}


def by_scikit_fem(
    mesh: xr.Dataset,
    material: dict[str, float],
    held: Callable[[np.ndarray], np.ndarray],
    load: Callable[[Any, skfem.Basis], np.ndarray],
) -> np.ndarray:
    """Nodal stress (n, 6) of a body under a load, all by scikit-fem; held: which places (3, ...) do not move."""
    element, nodes, cells = mesh.attrs["element"], mesh["node_position"].values, mesh["cell_node"].values
    corners = ELEMENTS[element].corners
    used, local = np.unique(cells[:, :corners], return_inverse=True)
    local = local.reshape(len(cells), corners).T
    hexes = element.startswith("hex")
    made = (
        skfem.MeshHex(nodes[used].T, local[[0, 3, 4, 1, 7, 2, 5, 6]]) if hexes else skfem.MeshTet(nodes[used].T, local)
    )
    basis = skfem.Basis(made, skfem.ElementVector(THEIRS[element]()), intorder=6)
    lame, shear = lame_parameters(material["youngs_modulus"], material["poisson"])
    stiffness = linear_elasticity(lame, shear).assemble(basis)
    fixed = np.flatnonzero(held(basis.doflocs))
    u = skfem.solve(*skfem.condense(stiffness, load(made, basis), D=fixed))
    return continued(nodes, cells, made, basis, u, hexes, (lame, shear))


def pulled_at_its_end(made: Any, basis: skfem.Basis) -> np.ndarray:
    """FORCE on a block, as a uniform traction at its end."""

    @skfem.LinearForm
    def traction(v: Any, w: Any) -> Any:
        return sum(f * v[k] for k, f in enumerate(FORCE)) / (SIZE[1] * SIZE[2])

    facets = made.facets_satisfying(lambda x: x[0] > SIZE[0] - 1e-9)
    return traction.assemble(skfem.FacetBasis(made, basis.elem, facets=facets, intorder=4))


def continued(
    nodes: np.ndarray,
    cells: np.ndarray,
    made: Any,
    basis: Any,
    u: np.ndarray,
    hexes: bool,
    material: tuple[float, float],
) -> np.ndarray:
    """Stress at Gauss points, a polynomial through them in each cell, the mean of the cells at each node."""
    if hexes:
        a = 0.5 - 0.5 / np.sqrt(3.0)
        points = np.array(np.meshgrid([a, 1 - a], [a, 1 - a], [a, 1 - a])).reshape(3, -1)
    elif cells.shape[1] == 4:
        points = np.full((3, 1), 0.25)
    else:
        b = (5.0 - np.sqrt(5.0)) / 20.0  # the four points of degree two
        points = b + (1.0 - 4.0 * b) * np.hstack([np.zeros((3, 1)), np.eye(3)])
    at = skfem.Basis(made, basis.elem, quadrature=(points, np.ones(points.shape[1])))
    slope, x = at.interpolate(u).grad, at.global_coordinates()
    lame, shear = material
    stress = (
        shear * (slope + np.swapaxes(slope, 0, 1)) + lame * np.einsum("kkcq->cq", slope) * np.eye(3)[..., None, None]
    )
    total, count = np.zeros((len(nodes), 6)), np.zeros(len(nodes))
    for c, cell in enumerate(cells):
        middle = nodes[cell].mean(axis=0)

        def powers(y: np.ndarray) -> np.ndarray:
            p, q, r = (y - middle).T / 0.01  # noqa: B023
            return np.column_stack([p**0, p, q, r, p * q, q * r, r * p, p * q * r][: points.shape[1]])

        fit = np.linalg.solve(powers(np.asarray(x)[:, c].T), components(np.moveaxis(stress[:, :, c], 2, 0)))
        total[cell] += powers(nodes[cell]) @ fit
        count[cell] += 1.0
    return total / count[:, None]


@pytest.mark.parametrize(
    "element, cells", [("hex8", (6, 2, 2)), ("hex27", (4, 2, 1)), ("tet4", (6, 2, 2)), ("tet10", (4, 1, 1))]
)
def test_a_cantilever_has_the_stress_of_scikit_fem_at_every_node(
    element: str, cells: tuple[int, int, int], tmp_path: Path
) -> None:
    """At the start, an equilibrium; a Craig-Bampton basis lacks nothing of loads at its interfaces."""
    recipe = block(element, cells, SIZE, "mean")
    recipe["frames"]["bottom"]["tie"] = "rigid"
    load = {"tip": {"type": "point-force", "frame": "part.top", "force": FORCE}}
    bundle, run = cantilever(tmp_path, recipe, CB, load=load, **STILL)
    mesh = build(recipe)
    theirs = by_scikit_fem(mesh, ALUMINIUM, lambda x: np.abs(x[0]) < 1e-9, pulled_at_its_end)
    shown, scale = nodes_of(mesh, bundle), np.abs(theirs).max()
    # measured 5e-11 to 3e-10, by what the levers of the deformed part are longer
    assert np.abs(everywhere(bundle, run, 0) - theirs[shown]).max() < 1e-8 * scale
    clear = bundle["node_doubtful"].values == 0
    assert run["von_mises_stress"].sel(gauge="part").values[0] == pytest.approx(
        von_mises(theirs[shown])[clear].max(), rel=1e-8
    )


# Closed forms ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("modes", [CB, {"reference": "free-free", "count": 7}, {"reference": "cantilever", "count": 2}])
def test_a_bar_in_tension_has_force_over_area_everywhere_whatever_the_modes(
    modes: dict[str, Any], tmp_path: Path
) -> None:
    """Uniform tractions at both ends; of held modes none stretches, and four free ones have a part of the answer."""
    load = {"pull": {"type": "point-force", "frame": "part.top", "force": [1e4 * FORCE[0], 0.0, 0.0]}}
    recipe = block("hex8", (6, 2, 1), SIZE, "mean")
    bundle, run = cantilever(tmp_path, recipe, modes, load=load, **STILL)
    exact = 1e4 * FORCE[0] / (SIZE[1] * SIZE[2])
    assert everywhere(bundle, run, 0) / exact == pytest.approx(
        np.tile(np.eye(6)[0], (bundle.sizes["node"], 1)), abs=1e-8
    )
    at = [
        run[name].sel(gauge="part").values[0]
        for name in ("von_mises_stress", "first_principal_stress", "third_principal_stress")
    ]
    assert at == pytest.approx([exact, exact, 0.0], abs=1e-8 * exact)


def bent(folder: Path, element: str, cells: tuple[int, int, int]) -> float:
    """Error of the stress at the outer fibre of a block under a torque, as a fraction of M c / I; gauge `mid`."""
    torque = 1e-3
    load = {"turn": {"type": "point-torque", "frame": "part.top", "torque": [0.0, 0.0, torque]}}
    gauges = {"mid": {"body": "part", "position": [0.5 * SIZE[0], 0.5 * SIZE[1], 0.5 * SIZE[2]]}}
    recipe = block(element, cells, SIZE, "mean")
    _, run = cantilever(folder, recipe, CB, load=load, output={"gauges": gauges}, **STILL)
    exact = torque * 0.5 * SIZE[1] / (SIZE[2] * SIZE[1] ** 3 / 12.0)
    assert run["third_principal_stress"].sel(gauge="part.mid").values[0] < 0.0
    return float(abs(run["von_mises_stress"].sel(gauge="part.mid").values[0] / exact - 1.0))


def test_pure_bending_is_exact_with_quadratic_cells_and_converges_with_linear_ones(tmp_path: Path) -> None:
    """M c / I: displacements are quadratic, so that cells of 27 nodes have them.

    Of cells of 8 nodes displacements converge with the second order and their slopes with the first: between them.
    """
    quadratic = bent(tmp_path, "hex27", (4, 1, 1))
    n = np.array([8, 16, 32])
    error = [bent(tmp_path, "hex8", (int(k), int(k) // 4, int(k) // 8)) for k in n]
    assert quadratic < 1e-10  # rounding; measured 1e-14
    # measured 0.20, 0.070, 0.026
    assert -2.0 < np.polyfit(np.log(n), np.log(error), 1)[0] < -1.0


def test_a_spinning_bar_has_the_tension_of_its_centrifugal_load(tmp_path: Path) -> None:
    """Three bending modes, none of which stretches: rho omega^2 (L^2 - x^2) / 2."""
    rate = 20.0
    drive = {"turn": {"joint": "clamp", "law": {"type": "polynomial", "coefficients": [0.0, rate]}}}
    joint = {"clamp": {"type": "revolute", "between": ["ground.wall", "part.bottom"]}}
    gauges = {"mid": {"body": "part", "position": [0.5 * SIZE[0], 0.5 * SIZE[1], 0.5 * SIZE[2]]}}
    modes = {"reference": "cantilever", "count": 3}
    recipe = block("hex20", (8, 1, 1), SIZE, "mean")
    _, run = cantilever(
        tmp_path, recipe, modes, drive=drive, joint=joint, output={"gauges": gauges}, time={"end": 1e-3}
    )
    exact = 0.5 * RHO * rate**2 * (SIZE[0] ** 2 - (0.5 * SIZE[0]) ** 2)
    got = run["stress_tensor"].sel(gauge="part.mid", tensor="xx").values
    # Poisson's part is of the order nu (b / L)^2 = 0.013; measured 0.0035
    assert got == pytest.approx(np.full(len(got), exact), rel=0.013)


def test_von_mises_does_not_know_the_axes_and_principal_stresses_add_up_to_the_trace() -> None:
    rng = np.random.default_rng(3)
    stress = rng.normal(size=(200, 6))
    R = np.linalg.qr(rng.normal(size=(200, 3, 3)))[0]
    turned = components(R @ matrices(stress) @ np.swapaxes(R, 1, 2))
    # rounding of some ten operations
    assert von_mises(turned) == pytest.approx(von_mises(stress), rel=1e-13)
    assert principal(turned) == pytest.approx(principal(stress), abs=1e-13)
    assert principal(stress).sum(axis=1) == pytest.approx(stress[:, :3].sum(axis=1), abs=1e-13)
    assert np.all(np.diff(principal(stress), axis=1) <= 0.0)


# In motion ------------------------------------------------------------------------------------------------------------


def full_model(mesh: xr.Dataset, time: np.ndarray, rate: float) -> np.ndarray:
    """Stress (time, node, 6) of the whole model, `bottom` held, under FORCE sin(rate t) on `top` from rest.

    Every mode of the model, each by its closed form.
    """
    model, spread = of_mesh(mesh).assemble(mesh), unknowns_of(mesh).spread
    frames = {frame.name: frame.motion for frame in model.interfaces}
    free = np.setdiff1d(np.arange(model.size), frames["bottom"].indices)
    K, M = (matrix[free][:, free].toarray() for matrix in (model.stiffness, model.mass))
    values, shapes = scipy.linalg.eigh(K, M)
    omega, load = np.sqrt(values), shapes.T @ (frames["top"].toarray()[:3].T @ FORCE)[free]
    q = load / (values - rate**2) * (np.sin(rate * time[:, None]) - rate / omega * np.sin(omega * time[:, None]))
    u = np.zeros((model.size, len(time)))
    u[free] = shapes @ q.T
    stress = at_nodes(solid_of(mesh), np.arange(mesh.sizes["node"]), spread @ u)
    return np.moveaxis(stress, 2, 0)


def test_a_shaken_cantilever_has_the_stress_of_the_full_model(tmp_path: Path) -> None:
    """From rest under a harmonic force: the more modes the nearer."""
    recipe = block("hex8", (8, 2, 1), SIZE, "mean")
    recipe["frames"]["bottom"]["tie"] = "rigid"
    # motions of 1e-7 m: well above the 1e-11 m that steps may err, and levers of the deformed part matter by some 1e-7
    larger = 1e3
    laws = [{"type": "harmonic", "amplitude": larger * f, "frequency": "200 Hz"} for f in FORCE]
    load = {"shake": {"type": "point-force", "frame": "part.top", "force": laws}}
    mesh, errors = build(recipe), []
    for count in (8, 16, 30):
        modes = {"reference": "craig-bampton", "count": count}
        bundle, run = cantilever(tmp_path, recipe, modes, load=load, time={"end": 2e-3})
        clear = bundle["node_doubtful"].values == 0
        exact = larger * full_model(mesh, run["time"].values, 400.0 * np.pi)[:, nodes_of(mesh, bundle)][:, clear]
        found = np.einsum("nsf,tf->tns", bundle["stress_field"].values, run["stress_factor"].values, optimize=True)
        scale = np.abs(exact).max()
        errors.append(float(np.abs(found[:, clear] - exact).max() / scale))
        largest = von_mises(exact).max(axis=1)
        # three components of either sign may add up in it
        assert run["von_mises_stress"].sel(gauge="part").values == pytest.approx(largest, abs=3.0 * errors[-1] * scale)
    # measured 3.3e-3, 8.6e-4, 1.6e-4: what remains are modes above 30 kHz that a force which begins with a jump of its
    # rate excites
    assert errors[0] < 0.01
    assert errors[1] < 0.5 * errors[0]
    assert errors[2] < 0.5 * errors[1]


# What is recorded -----------------------------------------------------------------------------------------------------


def test_gauges_are_nodes_of_a_frame_of_a_region_or_the_nearest_one(tmp_path: Path) -> None:
    """The largest of their nodes, and where it is; the peak leaves out cells that touch a rigid tie."""
    recipe = block("hex8", (6, 2, 1), SIZE, "mean")
    recipe["frames"]["bottom"]["tie"] = "rigid"
    gauges = {
        "foot": {"body": "part", "frame": "bottom"},
        "sides": {"body": "part", "region": "side"},
        "corner": {"body": "part", "position": [0.051, 0.0095, 0.005]},
    }
    load = {"tip": {"type": "point-force", "frame": "part.top", "force": FORCE}}
    bundle, run = cantilever(tmp_path, recipe, CB, load=load, output={"gauges": gauges}, **STILL)
    assert run["gauge"].values.tolist() == ["part", "part.foot", "part.sides", "part.corner"]
    every, x = von_mises(everywhere(bundle, run, 0)), bundle["node_position"].values
    chosen = {
        "part": x[:, 0] > SIZE[0] / 6.0 + 1e-9,
        "part.foot": x[:, 0] < 1e-9,
        "part.sides": np.ones(len(x), dtype=bool),
        "part.corner": np.linalg.norm(x - [0.05, 0.01, 0.005], axis=1) < 1e-9,
    }
    for name, nodes in chosen.items():
        here = run.sel(gauge=name).isel(time=0)
        assert float(here["von_mises_stress"]) == pytest.approx(every[nodes].max(), rel=1e-12)
        assert here["stress_position"].values == pytest.approx(x[nodes][np.argmax(every[nodes])], abs=1e-12)
    # the moment is largest at the foot, and a rigid foot cannot contract
    assert float(run["von_mises_stress"].sel(gauge="part.foot")[0]) > float(
        run["von_mises_stress"].sel(gauge="part")[0]
    )
    same = [fc.quantity(run, f"part.{word}").values for word in ("von_mises", "peak_von_mises", "von_mises_stress")]
    assert np.array_equal(same[0], same[1])
    assert np.array_equal(same[0], same[2])
    assert fc.quantity(run, "part.corner.von_mises").attrs["units"] == "Pa"


@pytest.mark.parametrize(
    "gauge, message",
    [
        ({"frame": "tip"}, r"\[output.gauges.g\] frame: unknown frame 'tip'"),
        ({"region": "sid"}, r"\[output.gauges.g\] region: unknown region 'sid'\n.*'side'"),
        ({"position": [1.0, 0.0, 0.0]}, r"\[output.gauges.g\] position: the nearest node of the surface, at .* m away"),
        ({}, r"gauges.g.*one of position, frame, region says where; here nothing does"),
        ({"body": "ground", "frame": "wall"}, r"'ground' is not a body in `stress`"),
    ],
)
def test_gauges_that_are_nowhere_are_refused(gauge: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(FlexclearError, match=message):
        cantilever(
            tmp_path, block("hex8", (2, 1, 1), SIZE, "mean"), CB, output={"gauges": {"g": {"body": "part"} | gauge}}
        )


def test_a_part_without_a_clear_node_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FlexclearError, match=r"cells at a rigidly tied frame.*\n.*refine"):
        cantilever(tmp_path, block("hex8", (2, 1, 1), SIZE, "rigid"), CB)


def test_a_rod_and_a_solid_are_recorded_side_by_side(tmp_path: Path) -> None:
    """The peak of a rod is that of its sections, its principal stresses those of bending and shear at that fibre."""
    run = run_with_sections("checks/clamped_rod", {"time.end": "1 ms"})
    largest = run["peak_von_mises_stress"].max("section")
    assert run["gauge"].values.tolist() == ["rod"]
    assert run["von_mises_stress"].sel(gauge="rod").values == pytest.approx(largest.values, rel=1e-12)
    stress = run["stress_tensor"].sel(gauge="rod").values
    axial, shear = stress[:, 0], np.hypot(stress[:, 4], stress[:, 5])
    exact = 0.5 * axial + np.sqrt(0.25 * axial**2 + shear**2)
    assert run["first_principal_stress"].sel(gauge="rod").values == pytest.approx(exact, abs=1e-9 * np.abs(axial).max())


def test_pictures_show_what_is_recorded(tmp_path: Path) -> None:
    """The colours of a page, and the peak in the post dataset, are those of the run."""
    recipe = block("hex8", (6, 2, 1), SIZE, "mean")
    load = {"tip": {"type": "point-force", "frame": "part.top", "force": FORCE}}
    bundle, run = cantilever(tmp_path, recipe, CB, load=load, time={"end": 2e-3})
    step = int(np.argmax(run["von_mises_stress"].sel(gauge="part").values))
    drawn = mechanism(run, {"part": bundle}, stressed=True)
    seen = body_shape.stress_on_surface(run, bundle, "part", step)
    assert seen == pytest.approx(von_mises(everywhere(bundle, run, step)), rel=1e-12)
    assert drawn.stress == pytest.approx(seen.max(), rel=1e-12)
    page = player.motion(drawn)
    (mesh,) = [mesh for mesh in page["meshes"] if "levels" in mesh]
    levels = np.frombuffer(base64.b64decode(mesh["levels"]), dtype=np.uint8).reshape(len(page["times"]), -1)
    assert levels.shape[1] == bundle.sizes["node"]
    assert levels.max() == 255
    derived = derive(run)
    peak = derived.sel(gauge="part")
    assert float(peak["peak_stress"]) == pytest.approx(seen.max(), rel=1e-12)
    assert float(peak["peak_stress_time"]) == run["time"].values[step]
    assert peak["peak_stress_position"].values == pytest.approx(
        bundle["node_position"].values[np.argmax(seen)], abs=1e-15
    )


def test_a_run_without_stress_has_no_picture_of_it(tmp_path: Path) -> None:
    run = run_with_sections("checks/clamped_rod", {"time.end": "0.2 ms"})
    bare = run.drop_vars([name for name in run if "gauge" in run[name].dims])
    with pytest.raises(FlexclearError, match=r"--what stress.*\n.*\[output\] stress"):
        mechanism(bare, {}, stressed=True)

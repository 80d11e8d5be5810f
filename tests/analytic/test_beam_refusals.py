"""Recipes of beams that are wrong: one clear message each, with the place and what to do."""

from typing import Any

import pytest

from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.structure.kinds import kind
from tests.analytic.beam_models import GENERAL, RECIPE, WITHOUT_SHAPE

CIRCLE = {"type": "circle", "radius": "10 mm"}


def segmented(*cuts: tuple[float, float], **more: Any) -> dict[str, Any]:
    segments = [{"start": a, "end": b, "elements": 3, "section": CIRCLE, **more} for a, b in cuts]
    return {**WITHOUT_SHAPE, "shape": {"type": "segmented-beam", "length": 0.24, "segments": segments}}


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "gap": (
        segmented((0.0, 0.1), (0.12, 0.24)),
        r"\[shape\].*between segment 0 \(0\.1 m\) and segment 1 \(0\.12 m\).*gap",
    ),
    "overlap": (segmented((0.0, 0.13), (0.12, 0.24)), r"\[shape\].*there is an overlap"),
    "too short": (
        segmented((0.0, 0.1), (0.1, 0.2)),
        r"\[shape\].*segment 1 \(0\.2 m\) and the rod's end \(0\.24 m\).*gap",
    ),
    "late start": (segmented((0.02, 0.24)), r"\[shape\].*between the rod \(0 m\) and segment 0 \(0\.02 m\).*gap"),
    "backwards": (segmented((0.24, 0.0)), r"\[shape\.segments\.0\].*ends after it starts"),
    "no segments": (segmented(), r"\[shape\].*between the rod \(0 m\) and the rod's end \(0\.24 m\).*gap"),
    "negative area": (RECIPE | {"section": GENERAL | {"area": "-3 mm^2"}}, r"\[section\.area\].*greater than 0"),
    "impossible product": (RECIPE | {"section": GENERAL | {"product": 7e-9}}, r"\[section\].*its square is below"),
    "negative inertia": (
        RECIPE | {"section": GENERAL | {"inertia": [1e-8, -1e-9, 1e-9]}},
        r"\[section\].*not negative",
    ),
    "wall": (
        RECIPE | {"section": {"type": "tube", "radius": "5 mm", "inner_radius": "6 mm"}},
        r"\[section\].*leaves no wall",
    ),
    "no kappa": (
        RECIPE | {"section": GENERAL, "theory": "timoshenko"},
        r"section: a Timoshenko beam needs the shear coefficient.*give shear_coefficient",
    ),
    "no kappa in a segment": (
        segmented((0.0, 0.24), section=GENERAL) | {"theory": "timoshenko"},
        r"\[shape\.segments\.0\.section\]: a Timoshenko beam needs the shear coefficient",
    ),
    "kappa above one": (
        RECIPE | {"section": CIRCLE | {"shear_coefficient": 1.2}},
        r"\[section\.shear_coefficient\].*at most 1",
    ),
    "unknown theory": (RECIPE | {"theory": "reissner"}, r"\[theory\].*'euler-bernoulli', 'rayleigh' or 'timoshenko'"),
    "unknown degree": (RECIPE | {"torsion": "cubic"}, r"\[torsion\].*'linear' or 'quadratic'"),
    "unknown shape": (
        RECIPE | {"shape": {"type": "strait-beam"}},
        r"\[shape\.type\](.|\n)*did you mean 'straight-beam'",
    ),
    "no shape": ({k: v for k, v in RECIPE.items() if k != "shape"}, r"\[shape\.type\]: is missing"),
    "taper of another type": (
        RECIPE | {"end_section": {"type": "rectangle", "width": 0.01, "height": 0.01}},
        r"taper keeps the type of the section; it cannot go from circle to rectangle",
    ),
    "taper of a general section": (RECIPE | {"section": GENERAL, "end_section": GENERAL}, "no dimensions to taper"),
    "kappa said twice": (RECIPE | {"end_section": CIRCLE | {"shear_coefficient": 0.9}}, "is said once, in `section`"),
    "mass at no node": (
        RECIPE | {"masses": {"ball": {"x": "67 mm", "mass": 1.0}}},
        r"\[masses\.ball\.x\]: 67 mm lies on no node.*60 mm and 80 mm(.|\n)*move the mass",
    ),
    "negative mass": (
        RECIPE | {"masses": {"ball": {"x": 0.0, "mass": -1.0}}},
        r"\[masses\.ball\.mass\].*greater than 0",
    ),
    "impossible inertia": (
        RECIPE | {"masses": {"ball": {"x": 0.0, "mass": 1.0, "inertia": [1.0, 1.0, 3.0]}}},
        r"\[masses\.ball\.inertia\].*belong to no body",
    ),
    "two orientations": (
        RECIPE | {"pose": {"rotation_vector": [0, 0, 1], "quaternion": [1, 0, 0, 0]}},
        r"\[pose\].*orientation is given once",
    ),
    "section next to segments": (segmented((0.0, 0.24)) | {"section": CIRCLE}, r"\[section\]: unknown key"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_recipes_are_refused_in_words(name: str) -> None:
    recipe, message = WRONG[name]
    with pytest.raises(InputError, match=message) as caught:
        kind.build(recipe, where="rod.toml")
    assert caught.value.exit_code == 2
    # one mistake, one message; the hint is a line of its own
    assert len([line for line in str(caught.value).splitlines() if line.startswith("rod.toml")]) == 1

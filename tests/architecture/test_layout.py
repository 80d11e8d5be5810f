"""The shape of the project: where things are, who imports whom, how long a module may be."""

import ast
import os
import re
import runpy
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from flexclear.commands.__main__ import COMMANDS
from tests.processes import copied, python

TOP = {"pyproject.toml", "pipeline", "meshes", "stages", "tests", "Makefile"}
BESIDES = {"README.md", "CHANGELOG.md", "CONTRIBUTING.md", "LICENSE", "constraints.txt", "docs", "scenes", "benchmarks"}
BESIDES |= {"CITATION.cff", "SECURITY.md", "papers", "setup.py", "MANIFEST.in"}
#: longest module; what does not fit is two things
LINES = 450


def sources(root: Path) -> list[Path]:
    folders = ("papers", "pipeline", "stages", "tests", "benchmarks")
    return [p for folder in folders for p in sorted((root / folder).rglob("*.py"))]


def test_top_level_is_as_agreed(root: Path):
    there = {path.name for path in root.iterdir() if not path.name.startswith(".")}
    assert there >= TOP
    assert there - TOP - BESIDES <= {"results", "build", "dist"}


def test_modules_stay_short(root: Path):
    long = {str(p.relative_to(root)): n for p in sources(root) if (n := len(p.read_text().splitlines())) > LINES}
    assert long == {}


def test_no_module_is_a_drawer(root: Path):
    """A name like `utils` says that nobody knew what the module is about."""
    drawers = {"utils", "util", "helpers", "misc", "common", "manager", "managers"}
    assert [p for p in sources(root) if p.stem in drawers and "tests" not in p.parts] == []


def _lint_imports(folder: Path) -> subprocess.CompletedProcess[str]:
    code = "from importlinter.cli import lint_imports_command as c; c()"
    return python("-c", code, "--no-cache", cwd=folder, succeeds=False)


def test_import_rules_hold(root: Path):
    done = _lint_imports(root)
    assert done.returncode == 0, done.stdout


#: module, what it must not import, and the beginning of the rule that says so
VIOLATIONS = [
    ("pipeline/flexclear/post/single_run/series.py", "flexclear.dynamics.memory", "three towers"),
    ("pipeline/flexclear/scene/units.py", "papers.wang_wang_2019.deviations", "three towers"),
    ("pipeline/flexclear/scene/units.py", "flexclear.artifacts.store", "three towers"),
    ("pipeline/flexclear/dynamics/memory.py", "flexclear.stages.graph", "three towers"),
    ("pipeline/flexclear/public.py", "flexclear.commands.run", "three towers"),
    ("papers/wang_wang_2019/deviations.py", "flexclear.dynamics.memory", "papers import the public functions"),
    ("papers/wang_wang_2019/deviations.py", "meshio", "finite elements"),
    ("pipeline/flexclear/stages/graph.py", "skfem", "finite elements"),
    ("pipeline/flexclear/dynamics/memory.py", "matplotlib", "plots"),
    ("papers/wang_wang_2019/deviations.py", "pyvista", "shapes"),
    ("pipeline/flexclear/dynamics/model/tree.py", "flexclear.dynamics.integrate.method", "dynamics follows"),
    ("pipeline/flexclear/dynamics/joints/free.py", "flexclear.dynamics.contact.wear", "dynamics follows"),
    ("pipeline/flexclear/structure/fe/model.py", "flexclear.structure.modes.normal", "no circles"),
]


def test_import_rules_can_be_broken(tmp_path: Path):
    """Each rule notices each violation, so that the test above means something."""
    copied(tmp_path)
    for module, other, _ in VIOLATIONS:
        with (tmp_path / module).open("a") as file:
            file.write(f"\nimport {other}\n")
    done = _lint_imports(tmp_path)
    assert done.returncode != 0
    broken = done.stdout.partition("Broken contracts")[2]
    parts = re.split(r"^(\w.*)\n-+\n", broken, flags=re.MULTILINE)
    said = {rule: " ".join(text.split()) for rule, text in zip(parts[1::2], parts[2::2], strict=True)}
    for module, other, begins in VIOLATIONS:
        (rule,) = (rule for rule in said if rule.startswith(begins))
        importer = module.removeprefix("pipeline/").removesuffix(".py").replace("/", ".")
        assert (".fe -> .modes" if rule == "no circles" else f"{importer} -> {other}") in said[rule]


def test_nothing_below_the_commands_names_a_module_of_them(root: Path):
    """The linter sees no names that are put together when they are needed."""
    up = re.compile(r"""["'](flexclear\.(commands|public)[."']|papers\.)""")
    above = {root / "pipeline" / "flexclear" / name for name in ("commands", "__init__.py")}
    found = [p for p in (root / "pipeline").rglob("*.py") if not above & {p, *p.parents} and up.search(p.read_text())]
    assert found == []


def test_every_dependency_is_pinned(root: Path):
    """Two installs a month apart get the same versions."""
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    pinned = {
        line.partition("==")[0].lower().replace("_", "-")
        for line in (root / "constraints.txt").read_text().splitlines()
        if "==" in line
    }
    extras = project["optional-dependencies"]
    requested = [*project["dependencies"], *extras["dev"], *extras["render"]]
    assert {re.split(r"[<>=]", name)[0].lower() for name in requested} <= pinned


def test_every_library_that_is_imported_is_declared(root: Path):
    """An indirect dependency may vanish with the next version of what brought it."""
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    requested = [*project["dependencies"], *extras["render"], *extras["cluster"], *extras["med"], *extras["robots"]]
    requested += extras["notebooks"]
    declared = {re.split(r"[<>=]", name)[0].lower().replace("-", "_") for name in requested}
    declared |= {"skfem", "vtkmodules", "markdown_it", "flexclear", "papers"} | set(sys.stdlib_module_names)
    found = set()
    for path in sources(root):
        if path.parts[len(root.parts)] in ("papers", "pipeline", "stages"):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.Import):
                    found |= {alias.name.partition(".")[0] for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and not node.level:
                    found.add((node.module or "").partition(".")[0])
    assert {name.lower() for name in found} <= {name.lower() for name in declared}


def test_no_path_of_a_developers_machine(root: Path):
    """Everything here must mean the same on every machine."""
    home = re.compile(r"(?<![\w.])/(?:home|Users|root|work|farm)/\w")
    folders = (".ci", "docs", "scenes", "meshes", "papers", "pipeline", "stages", "tests", "benchmarks")
    files = [*root.glob("*"), *(path for folder in folders for path in (root / folder).rglob("*"))]
    texts = {".py", ".md", ".toml", ".txt", ".json", ".sh", ""}
    visible = [p for p in files if p.is_file() and p.suffix in texts and not _hidden(p.relative_to(root))]
    assert len(visible) > 50
    found = [f"{p}: {line}" for p in visible for line in p.read_text().splitlines() if home.search(line)]
    assert found == []


def _hidden(path: Path) -> bool:
    return any(part.startswith(".") for part in path.parts if part != ".ci")


def test_the_readme_names_only_commands_that_exist(root: Path):
    text = (root / "README.md").read_text()
    verbs = re.findall(r"`flexclear ([a-z]+)", text)
    assert len(verbs) >= 6
    assert set(verbs) == set(COMMANDS)
    targets = set(re.findall(r"^([a-z-]+):.*##", (root / "Makefile").read_text(), re.MULTILINE))
    assert set(re.findall(r"\bmake ([a-z-]+)", text)) <= targets
    for link in re.findall(r"\]\(([^)#]+)\)", text):
        assert link.startswith("http") or (root / link).exists(), link


@pytest.mark.parametrize("options", [(), ("-w",), ("-C", ".")], ids=["plain", "telling folders", "from elsewhere"])
@pytest.mark.parametrize("outer", [{}, {"MAKELEVEL": "1", "MAKEFLAGS": "w"}], ids=["shell", "below make"])
def test_the_makefile_lists_itself(root: Path, options: tuple[str, ...], outer: dict[str, str]):
    """However make is called: below another make, as in `make test`, and with -w it tells the folders it enters."""
    make = shutil.which("make")
    assert make is not None
    shell = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")} | outer
    listed = subprocess.run([make, *options, "help"], cwd=root, env=shell, capture_output=True, text=True, check=True)
    phony = re.search(r"^\.PHONY: (.*)$", (root / "Makefile").read_text(), re.MULTILINE)
    assert phony is not None
    of_make = re.compile(r"make(\[\d+\])?: ")
    lines = [line for line in listed.stdout.splitlines() if not of_make.match(line)]
    assert {line.split()[1] for line in lines} == set(phony[1].split())


def test_what_must_pass_is_what_a_user_types(root: Path):
    """Flags of its own would hide what goes wrong without them."""
    text = (root / ".ci" / "run").read_text()
    assert re.findall(r"^\s*make\b(.*)$", text, re.MULTILINE) == [' "$1"']
    targets = re.findall(r"^run (\w+)", text, re.MULTILINE)
    assert targets == ["setup", "interpreters", "check", "docs", "test"]


def test_the_lowest_versions_are_those_that_are_declared(root: Path):
    """`make interpreters` runs with them."""
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    lowest = dict(
        line.lower().split("==") for line in (root / ".ci" / "lowest.txt").read_text().splitlines() if "==" in line
    )
    for requirement in project["dependencies"]:
        name, _, bounds = requirement.lower().partition(">=")
        bound = bounds.partition(",")[0]
        assert lowest[name] == bound or lowest[name].startswith(f"{bound}."), requirement


def test_wheels_hold_scenes_and_meshes_next_to_the_code(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """What setup.py adds to the packages that setuptools finds; nothing else is built here."""
    setuptools = pytest.importorskip("setuptools")
    monkeypatch.chdir(root)
    monkeypatch.setattr(setuptools, "setup", lambda **_: None)
    step = runpy.run_path("setup.py")["BuildWithData"](setuptools.Distribution({"packages": []}))
    step.build_lib, step.editable_mode = str(tmp_path / "wheel"), False
    step.finalize_options()
    step.run()
    data = {p.relative_to(root) for top in ("scenes", "meshes") for p in (root / top).rglob("*") if p.is_file()}
    assert len(data) > 60
    assert {p.relative_to(tmp_path / "wheel/flexclear") for p in tmp_path.rglob("*") if p.is_file()} == data


def test_there_is_one_script_and_it_is_the_command(root: Path) -> None:
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    assert project["scripts"] == {"flexclear": "flexclear.commands.__main__:main"}


def test_no_source_is_a_link(root: Path) -> None:
    """Each file has one path, which every tool finds."""
    folders = ("papers", "pipeline", "stages", "scenes", "meshes", "tests", "benchmarks")
    assert [p for folder in folders for p in (root / folder, *(root / folder).rglob("*")) if p.is_symlink()] == []

"""Which source a result depends on: the static import closure of modules, and their digests.

A module counts by its syntax tree without comments, docstrings and the words of the errors that it raises: wording
changes no result.  Only names below `OWN` are followed; other top-level imports are libraries, which count by their
version. Parts that are looked up by name at run time are not seen here: whoever builds a task
names their modules as further roots.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any

from flexclear.pipeline.core.artifacts.disk import checked, digest_of, publish, read_checked
from flexclear.pipeline.core.artifacts.paths import TREE as TREE

OWN = ("flexclear", "benchmarks")
#: modules that only word messages, citations and validation errors: no result depends on them
_SCENE = "flexclear.pipeline.core.scene"
WORDING = {f"{_SCENE}.{name}" for name in ("citations", "validation_errors", "plausibility")}
#: what the code of a package reads next to its modules
ASSETS = (".css", ".js")
#: how often a source is parsed at most, where threads of libraries come between
ATTEMPTS = 10
_PARSING = Lock()
#: libraries that decide on no result: locks, folders, and what the machine has left
MACHINE = {"filelock", "platformdirs", "psutil"}
#: distributions whose name differs from that of their import package
DISTRIBUTIONS = {"skfem": "scikit-fem", "imageio_ffmpeg": "imageio-ffmpeg", "vtkmodules": "vtk"}


@dataclass(frozen=True, slots=True)
class Module:
    """One source file. text, digest: digests of its bytes and of its code.

    own, libraries: modules and libraries that it imports.  package: whether others may lie below.
    """

    text: str
    digest: str
    own: tuple[str, ...]
    libraries: tuple[str, ...]
    package: bool

    def written(self) -> list[Any]:
        """As the memo of a `Sources` has it."""
        return [self.text, self.digest, list(self.own), list(self.libraries)]


@dataclass(frozen=True)
class Sources:
    """The source tree under `root`, each file read at most once.

    memo: file that remembers what each module imports, and the digest of the text that says so;
    only edited files are parsed then.  None parses all of them.
    A source is assumed not to change while one process looks at it.
    """

    root: Path
    memo: Path | None = None
    read: dict[str, Module | None] = field(default_factory=dict, repr=False, compare=False)
    remembered: dict[str, list[Any]] = field(default_factory=dict, repr=False, compare=False)
    next: dict[str, tuple[str, ...]] = field(default_factory=dict, repr=False, compare=False)
    closures: dict[frozenset[str], dict[str, Module]] = field(default_factory=dict, repr=False, compare=False)

    def closure(self, roots: Iterable[str]) -> dict[str, Module]:
        """Every own module that `roots` reach by imports, packages on the way included.

        Raises LookupError for a root that is no module of the tree.
        """
        requested = frozenset(roots)
        if requested not in self.closures:
            if self.memo is not None and not self.remembered:
                self.remembered.update(read_checked(self.memo) or {})
            self.closures[requested] = self._reach(requested)
            new = {name: module.written() for name, module in self.closures[requested].items()}
            if self.memo is not None and any(self.remembered.get(name) != entry for name, entry in new.items()):
                self.remembered.update(new)
                with contextlib.suppress(OSError):
                    publish(self.memo, checked(self.remembered))
        return self.closures[requested]

    def code(self, roots: Iterable[str]) -> dict[str, str]:
        """Facts of the code that `roots` reach, by kind and name: digests of modules and of the assets of packages,
        versions of libraries."""
        closure = self.closure(roots)
        libraries = frozenset().union(*(module.libraries for module in closure.values())) - MACHINE
        return {f"module {name}": module.digest for name, module in closure.items() if name not in WORDING} | {
            **{f"asset {path.name}": digest_of(path) for path in self._assets(closure)},
            **{f"library {name}": version for name, version in library_versions(libraries).items()},
        }

    def _assets(self, closure: Mapping[str, Module]) -> Iterator[Path]:
        """Files next to the modules of packages that their code reads."""
        for name, module in closure.items():
            source = source_file(self.root, name) if module.package else None
            if source is not None:
                yield from (source.parent / entry for entry in os.listdir(source.parent) if entry.endswith(ASSETS))

    def module(self, name: str) -> Module | None:
        """The module called `name`, or None when there is no such file (an attribute, say)."""
        if name not in self.read:
            above = self.read.get(name.rpartition(".")[0])
            # most names are of what modules hold: four files less to look for
            path = source_file(self.root, name) if above is None or above.package else None
            self.read[name] = None if path is None else self._parse(path, name)
        return self.read[name]

    def _reach(self, requested: frozenset[str]) -> dict[str, Module]:
        modules: dict[str, Module] = {}
        waiting = sorted(requested)
        for name in waiting:
            if self.module(name) is None:
                raise LookupError(f"no module {name} under {self.root}")
        while waiting:
            name = waiting.pop()
            module = self.read[name]
            if name not in modules and module is not None:
                modules[name] = module
                waiting.extend(self._next(name, module))
        return modules

    def _next(self, name: str, module: Module) -> tuple[str, ...]:
        """The modules that one reaches at once: what it imports may be an attribute of a module, and no module."""
        if name not in self.next:
            reached = sorted({*module.own, *parents(name)})  # a module before the names that it holds
            self.next[name] = tuple(other for other in reached if self.module(other) is not None)
        return self.next[name]

    def _parse(self, path: Path, name: str) -> Module:
        source, package = path.read_bytes(), path.name == "__init__.py"
        text, *known = self.remembered.get(name, [""])
        if text != hashlib.sha256(source).hexdigest() or len(known) != 3:
            return _examined(source, name, package)
        digest, own, libraries = known
        return Module(text, digest, tuple(own), tuple(libraries), package)


@cache
def _examined(source: bytes, name: str, package: bool) -> Module:
    tree = _parsed(source)
    own, libraries = (tuple(sorted(names)) for names in _imported(tree, name, package, deep=True))
    code = code_digest(tree)
    return Module(hashlib.sha256(source).hexdigest(), code, own, libraries, package)


#: this program's own modules, as this process has read them
_OWN_MODULES: dict[str, Module | None] = {}


def sources_of(root: Path, memo: Path | None = None) -> Sources:
    """The source tree under `root`; this program's own is read once by a process, which runs what it was then."""
    return Sources(root, memo, _OWN_MODULES if root == TREE else {})


def source_file(root: Path, name: str) -> Path | None:
    """The file of the module called `name` in the source tree under `root`, or None when there is none."""
    first, _, rest = name.partition(".")
    # in a checkout whose links are not followed the packages below `flexclear` are next to it
    places = [name, *([rest] if first == "flexclear" and rest else [])]
    # hundreds of modules are searched for by every command: paths as texts take a fifth of the time
    bases = [f"{root}{os.sep}{place.replace('.', os.sep)}" for place in places]
    files = (path for base in bases for path in (f"{base}.py", f"{base}{os.sep}__init__.py"))
    return next((Path(path) for path in files if os.path.isfile(path)), None)


def parents(name: str) -> list[str]:
    """Packages above a module: ``a.b.c`` -> ``a.b``, ``a``."""
    parts = name.split(".")
    return [".".join(parts[:n]) for n in range(1, len(parts))]


def imported(source: bytes, name: str, package: bool, *, deep: bool = True) -> tuple[set[str], set[str]]:
    """Own names and libraries that one source text imports; imports for type checkers do not count.

    deep: also in functions, which import what only some need.
    """
    return _imported(_parsed(source), name, package, deep)


def _imported(tree: ast.Module, name: str, package: bool, deep: bool) -> tuple[set[str], set[str]]:
    own: set[str] = set()
    libraries: set[str] = set()
    for target in _imports(tree.body, name if package else name.rpartition(".")[0], deep):
        top = target.partition(".")[0]
        if top in OWN:
            own.add(target)
        elif top not in sys.stdlib_module_names:
            libraries.add(top)
    return own, libraries


def code_digest(tree: ast.Module) -> str:
    """Digest of what a module does: its syntax tree without docstrings, also of attributes, and words of errors."""
    for node in ast.walk(tree):
        if isinstance(node, _DOCUMENTED):
            node.body = [one for one in node.body if not _is_text(one)]
        elif isinstance(node, ast.Raise):
            for part in ast.walk(node):
                if isinstance(part, ast.JoinedStr):
                    part.values = []
                elif isinstance(part, ast.Constant) and isinstance(part.value, str):
                    part.value = ""
    return hashlib.sha256(_dumped(tree).encode()).hexdigest()


def _is_text(statement: ast.stmt) -> bool:
    """Whether a statement is a text alone, which does nothing."""
    value = statement.value if isinstance(statement, ast.Expr) else None
    return isinstance(value, ast.Constant) and isinstance(value.value, str)


def _dumped(tree: ast.Module) -> str:
    """The text of a syntax tree, the same from all releases of Python: some leave out what is empty, or lack it."""
    whole: dict[str, Any] = {"show_empty": True} if sys.version_info >= (3, 13) else {}
    return ast.dump(tree, **whole).replace(", type_params=[]", "")


_DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def _parsed(source: bytes) -> ast.Module:
    """The syntax tree. CPython has one counter of how deep all threads are in theirs, and may find that it is wrong.

    That is so in 3.11 and 3.12 at least (its issue 106905); runs, perturbed runs and members of ensembles are threads.
    """
    for _ in range(ATTEMPTS):
        with contextlib.suppress(SystemError), _PARSING:  # libraries parse as well, and wait for nobody
            return ast.parse(source)
    return ast.parse(source)


def _imports(statements: Iterable[ast.stmt], package: str, deep: bool) -> Iterable[str]:
    """Dotted names that statements import, those of functions only if `deep`; ``from a import b`` gives a and a.b."""
    for node in statements:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) + 1 - node.level] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.If) and _is_type_checking(node.test):
            yield from _imports(node.orelse, package, deep)
        elif isinstance(node, ast.Match):
            yield from (name for case in node.cases for name in _imports(case.body, package, deep))
        elif deep or not isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            # imports are statements, so expressions need not be walked
            for block in ("body", "orelse", "handlers", "finalbody"):
                yield from _imports(getattr(node, block, ()), package, deep)


def _is_type_checking(test: ast.expr) -> bool:
    name = test.attr if isinstance(test, ast.Attribute) else getattr(test, "id", "")
    return name == "TYPE_CHECKING"


@cache
def library_versions(packages: frozenset[str]) -> dict[str, str]:
    """Versions of the libraries that hold these import packages, and of all that those require in turn."""
    versions = {name: library_version(name) for name in packages}
    waiting = sorted(packages)
    while waiting:
        for name in _required(waiting.pop()):
            if name not in versions and library_version(name) != "absent":
                versions[name] = library_version(name)
                waiting.append(name)
    return dict(sorted(versions.items()))


@cache
def library_version(package: str) -> str:
    """Version of the distribution that holds an import package; 'absent' when it is not installed."""
    from importlib.metadata import PackageNotFoundError, version  # here, since it brings readers of e-mail

    try:
        return version(DISTRIBUTIONS.get(package, package))
    except PackageNotFoundError:
        return "absent"


@cache
def _required(package: str) -> tuple[str, ...]:
    """Distributions that a library requires whatever is asked of it; some only on other machines."""
    from importlib.metadata import PackageNotFoundError, requires

    try:
        lines = (line.partition(";") for line in requires(DISTRIBUTIONS.get(package, package)) or ())
    except PackageNotFoundError:
        return ()
    return tuple(re.split(r"[^\w.-]", name, maxsplit=1)[0] for name, _, condition in lines if "extra" not in condition)

"""Sources that a result depends on: the static import closure of modules, and their digests.

A module counts by its syntax tree without comments, docstrings and the words of the errors that it raises: wording
changes no result. Only names below `OWN` are followed; other top-level imports are libraries, which count by their
version. Parts looked up by name at run time are not visible here: code that builds a task names their modules as
further roots.
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

from flexclear.artifacts.disk import checked, digest_of, publish, read_checked
from flexclear.artifacts.paths import TREE as TREE

#: packages whose modules count by their code: the program, and applications next to its sources in a checkout
OWN = ("flexclear", "papers", "benchmarks")
#: modules that only word messages, citations and validation errors: no result depends on them
_SCENE = "flexclear.scene"
WORDING = {f"{_SCENE}.{name}" for name in ("citations", "validation_errors", "plausibility")}
#: suffixes of the files that the code of a package reads next to its modules
ASSETS = (".css", ".js")
#: attempts to parse a source, which concurrent threads of libraries may disturb
ATTEMPTS = 10
_PARSING = Lock()
#: libraries that affect no result: locks, folders, remaining resources of the machine
MACHINE = {"filelock", "platformdirs", "psutil"}
#: distributions whose name differs from that of their import package
DISTRIBUTIONS = {"skfem": "scikit-fem", "imageio_ffmpeg": "imageio-ffmpeg", "vtkmodules": "vtk"}


@dataclass(frozen=True, slots=True)
class Module:
    """One source file. text, digest: digests of its bytes and of its code.

    own, libraries: modules and libraries that it imports. package: whether other modules may be below it.
    """

    text: str
    digest: str
    own: tuple[str, ...]
    libraries: tuple[str, ...]
    package: bool

    def written(self) -> list[Any]:
        """Return the entry of this module in the memo of a `Sources`."""
        return [self.text, self.digest, list(self.own), list(self.libraries)]


@dataclass(frozen=True)
class Sources:
    """The source tree under `root`; each file is read at most once.

    memo: file with the imports of each module and the digest of the text they were read from, so that only edited files
    are parsed. None parses all files. Sources are assumed not to change while one process reads them.
    """

    root: Path
    memo: Path | None = None
    read: dict[str, Module | None] = field(default_factory=dict, repr=False, compare=False)
    remembered: dict[str, list[Any]] = field(default_factory=dict, repr=False, compare=False)
    next: dict[str, tuple[str, ...]] = field(default_factory=dict, repr=False, compare=False)
    closures: dict[frozenset[str], dict[str, Module]] = field(default_factory=dict, repr=False, compare=False)

    def closure(self, roots: Iterable[str]) -> dict[str, Module]:
        """Return every own module that `roots` reach by imports, including the packages above.

        Raises LookupError for a root that is not a module of the tree.
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
        """Return facts of the code that `roots` reach, by kind and name: digests of modules and of assets of packages,
        versions of libraries."""
        closure = self.closure(roots)
        libraries = frozenset().union(*(module.libraries for module in closure.values())) - MACHINE
        return {f"module {name}": module.digest for name, module in closure.items() if name not in WORDING} | {
            **{f"asset {path.name}": digest_of(path) for path in self._assets(closure)},
            **{f"library {name}": version for name, version in library_versions(libraries).items()},
        }

    def _assets(self, closure: Mapping[str, Module]) -> Iterator[Path]:
        """Yield the files next to the modules of packages that their code reads."""
        for name, module in closure.items():
            source = source_file(self.root, name) if module.package else None
            if source is not None:
                yield from (source.parent / entry for entry in os.listdir(source.parent) if entry.endswith(ASSETS))

    def module(self, name: str) -> Module | None:
        """Return the module called `name`, or None when it has no file (an attribute, say)."""
        if name not in self.read:
            above = self.read.get(name.rpartition(".")[0])
            # most names are attributes of modules: this saves the search for four files
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
        """Return the modules that a module reaches directly; imported names that are attributes are dropped."""
        if name not in self.next:
            reached = sorted({*module.own, *parents(name)})  # a module comes before its attributes
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


#: this program's own modules, in the state in which this process read them
_OWN_MODULES: dict[str, Module | None] = {}


def sources_of(root: Path, memo: Path | None = None) -> Sources:
    """Return the source tree under `root`; this program's own is read once per process, which runs that state."""
    return Sources(root, memo, _OWN_MODULES if root == TREE else {})


def source_file(root: Path, name: str) -> Path | None:
    """Return the file of the module called `name`; None without such a file.

    root: folder with the package `flexclear`; applications such as `papers` are in the folder above it.
    """
    # every command searches for hundreds of modules: text paths take a fifth of the time of Path objects
    folder = root if name.startswith(OWN[0]) else root.parent
    base = f"{folder}{os.sep}{name.replace('.', os.sep)}"
    return next((Path(path) for path in (f"{base}.py", f"{base}{os.sep}__init__.py") if os.path.isfile(path)), None)


def parents(name: str) -> list[str]:
    """Return the packages above a module: ``a.b.c`` -> ``a.b``, ``a``."""
    parts = name.split(".")
    return [".".join(parts[:n]) for n in range(1, len(parts))]


def imported(source: bytes, name: str, package: bool, *, deep: bool = True) -> tuple[set[str], set[str]]:
    """Return own names and libraries that one source text imports; imports for type checkers do not count.

    deep: also imports inside functions.
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
    """Return the digest of a module's syntax tree without docstrings, also of attributes, and words of errors."""
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
    """Return True for a statement that is only a text, which has no effect."""
    value = statement.value if isinstance(statement, ast.Expr) else None
    return isinstance(value, ast.Constant) and isinstance(value.value, str)


def _dumped(tree: ast.Module) -> str:
    """Return a syntax tree as text, equal in all releases of Python: some omit empty fields, some lack them."""
    whole: dict[str, Any] = {"show_empty": True} if sys.version_info >= (3, 13) else {}
    return ast.dump(tree, **whole).replace(", type_params=[]", "")


_DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def _parsed(source: bytes) -> ast.Module:
    """Return the syntax tree. CPython counts the nesting depth of all threads together and may find the count wrong.

    This occurs at least in 3.11 and 3.12 (its issue 106905); runs, perturbed runs and ensemble members are threads.
    """
    for _ in range(ATTEMPTS):
        with contextlib.suppress(SystemError), _PARSING:  # libraries parse as well, without this lock
            return ast.parse(source)
    return ast.parse(source)


def _imports(statements: Iterable[ast.stmt], package: str, deep: bool) -> Iterable[str]:
    """Yield dotted names that statements import, in functions only if `deep`; ``from a import b`` gives a and a.b."""
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
    """Return the versions of the libraries of these import packages, and of all libraries that they require."""
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
    """Return the version of the distribution of an import package; 'absent' when it is not installed."""
    from importlib.metadata import PackageNotFoundError, version  # here, since it imports the e-mail package

    try:
        return version(DISTRIBUTIONS.get(package, package))
    except PackageNotFoundError:
        return "absent"


@cache
def _required(package: str) -> tuple[str, ...]:
    """Return the distributions that a library requires without extras; some only on other machines."""
    from importlib.metadata import PackageNotFoundError, requires

    try:
        lines = (line.partition(";") for line in requires(DISTRIBUTIONS.get(package, package)) or ())
    except PackageNotFoundError:
        return ()
    return tuple(re.split(r"[^\w.-]", name, maxsplit=1)[0] for name, _, condition in lines if "extra" not in condition)

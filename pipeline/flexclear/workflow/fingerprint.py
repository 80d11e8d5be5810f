"""Digests of the program's code, and versions of libraries, on which results depend.

Code counts by package: by the syntax trees of its modules without comments, docstrings and the words of the errors that
they raise, since wording changes no result, and by the style and scripts next to them.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import os
import sys
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any

from flexclear.artifacts.disk import encode_with_digest, publish, read_checked
from flexclear.artifacts.paths import TREE as TREE

#: packages whose modules count by their code: the program, and applications next to its sources in a checkout
OWN = ("flexclear", "papers", "benchmarks")
#: packages below all stages, whose code every result depends on
CORE = tuple(f"{OWN[0]}.{name}" for name in ("system", "numerics", "scene", "artifacts", "workflow"))
#: suffixes of the files that count: modules, and what pages are made of
COUNTED = (".py", ".css", ".js")
_PARSING = Lock()
#: libraries that affect no result: locks, folders, remaining resources of the machine
MACHINE = {"filelock", "platformdirs", "psutil"}
#: distributions whose name differs from that of their import package
DISTRIBUTIONS = {"skfem": "scikit-fem", "imageio_ffmpeg": "imageio-ffmpeg", "vtkmodules": "vtk"}


@dataclass(frozen=True)
class Sources:
    """The source tree under `root`; each file is read at most once, and assumed not to change while it is in use.

    memo: file with the digest of each file's code and the libraries that it imports, next to the digest of its bytes,
    so that only edited files are parsed. None parses all files.
    """

    root: Path
    memo: Path | None = None
    read: dict[str, list[Any]] = field(default_factory=dict, repr=False, compare=False)
    remembered: dict[str, list[Any]] = field(default_factory=dict, repr=False, compare=False)

    def code(self, names: Iterable[str]) -> dict[str, str]:
        """Return facts of packages or modules: the digest of each, and the versions of the libraries they import."""
        found, libraries = dict[str, str](), set[str]()
        for name in names:
            files = self.files(name)
            found[f"code of {name.removeprefix(f'{OWN[0]}.')}"] = _digest_of(files)
            libraries.update(*(libraries for _, _, libraries in files.values()))
        return found | {f"library {name}": library_version(name) for name in sorted(libraries - MACHINE)}

    def digest(self, name: str, without: Collection[str] = ()) -> str:
        """Return the digest of the code of a package; without: names of its modules and packages that do not count."""
        start = len(_place(name)) + 1
        files = self.files(name).items()
        return _digest_of(
            {path: of for path, of in files if path[start:].split("/")[0].removesuffix(".py") not in without}
        )

    def files(self, name: str) -> dict[str, list[Any]]:
        """Return digest of the bytes, digest of the code and libraries of each file of a package or module, by path.

        Raises LookupError when there is no such package or module.
        """
        if self.memo is not None and not self.remembered:
            self.remembered.update(read_checked(self.memo) or {})
        paths = sorted(_files(self._folder(name), _place(name)))
        if not paths:
            raise LookupError(f"no module {name} under {self.root}")
        found = {path: self._read(path) for path in paths}
        if self.memo is not None and any(self.remembered.get(path) != of for path, of in found.items()):
            self.remembered.update(found)
            with contextlib.suppress(OSError):
                publish(self.memo, encode_with_digest(self.remembered))
        return found

    def _folder(self, name: str) -> Path:
        """Return the folder with a package: applications such as `papers` are in the folder above the root."""
        return self.root if name.partition(".")[0] == OWN[0] else self.root.parent

    def _read(self, path: str) -> list[Any]:
        if path not in self.read:
            source = (self._folder(path.replace("/", ".")) / path).read_bytes()
            known = self.remembered.get(path, [""])
            text = hashlib.sha256(source).hexdigest()
            self.read[path] = (
                known if known[0] == text else [text, *_digest_and_libraries(source, path.endswith(".py"))]
            )
        return self.read[path]


def _place(name: str) -> str:
    return name.replace(".", "/")


def _files(folder: Path, place: str) -> Iterator[str]:
    """Yield the paths of the files of a package or module below a folder."""
    if (folder / f"{place}.py").is_file():
        yield f"{place}.py"
    for below, folders, names in os.walk(folder / place):
        folders[:] = [name for name in folders if name != "__pycache__"]
        inside = os.path.relpath(below, folder).replace(os.sep, "/")
        yield from (f"{inside}/{name}" for name in names if name.endswith(COUNTED))


def _digest_of(files: dict[str, list[Any]]) -> str:
    return hashlib.sha256(repr([(path, code) for path, (_, code, _) in files.items()]).encode()).hexdigest()


@cache
def _digest_and_libraries(source: bytes, module: bool) -> tuple[str, list[str]]:
    """Return the digest of the code of a file, and the libraries that it imports."""
    if not module:
        return hashlib.sha256(source).hexdigest(), []
    tree = _parse(source)
    libraries = set(_top_level_imports(tree)) - {*OWN, *sys.stdlib_module_names}
    return code_digest(tree), sorted(libraries)


#: this program's own files, in the state in which this process read them
_OWN_FILES: dict[str, list[Any]] = {}


def sources_of(root: Path, memo: Path | None = None) -> Sources:
    """Return the source tree under `root`; this program's own is read once per process, which runs that state."""
    return Sources(root, memo, _OWN_FILES if root == TREE else {})


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
    return hashlib.sha256(_tree_text(tree).encode()).hexdigest()


def _is_text(statement: ast.stmt) -> bool:
    """Return True for a statement that is only a text, which has no effect."""
    value = statement.value if isinstance(statement, ast.Expr) else None
    return isinstance(value, ast.Constant) and isinstance(value.value, str)


def _tree_text(tree: ast.Module) -> str:
    """Return a syntax tree as text, equal in all releases of Python: some omit empty fields, some lack them."""
    whole: dict[str, Any] = {"show_empty": True} if sys.version_info >= (3, 13) else {}
    return ast.dump(tree, **whole).replace(", type_params=[]", "")


_DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def _parse(source: bytes) -> ast.Module:
    """Return the syntax tree. CPython counts the nesting depth of all threads together and may find the count wrong.

    This occurs at least in 3.11 and 3.12 (its issue 106905); runs, perturbed runs and ensemble members are threads.
    """
    # 10: attempts to parse a source, which concurrent threads of libraries may disturb
    for _ in range(10):
        with contextlib.suppress(SystemError), _PARSING:  # libraries parse as well, without this lock
            return ast.parse(source)
    return ast.parse(source)


def _top_level_imports(tree: ast.Module) -> Iterator[str]:
    """Yield the top-level names that a module imports anywhere."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield str(node.module).partition(".")[0]


@cache
def library_version(package: str) -> str:
    """Return the version of the distribution of an import package; 'absent' when it is not installed."""
    from importlib.metadata import PackageNotFoundError, version  # here, since it imports the e-mail package

    try:
        return version(DISTRIBUTIONS.get(package, package))
    except PackageNotFoundError:
        return "absent"

"""Binary files of Ansys, read by ansys-mapdl-reader in a process of its own: a damaged file may end its reader."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

import numpy as np

from flexclear.system import machine
from flexclear.system.errors import InputError

#: writes matrices, or numbers, positions and sets of nodes; held unknowns have the number `held`
SCRIPT = """
import sys
import numpy as np
import scipy.sparse as sp
from ansys.mapdl import reader
path, target, most = sys.argv[1:]
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (int(most), int(most)))
except ImportError:
    pass
if path.lower().endswith(".full"):
    file = reader.read_binary(path)
    unknowns, K, M = file.load_km(sort=False)
    data = {"node": unknowns[:, 0], "component": unknowns[:, 1], "held": np.array(len(file.const))}
    for name, matrix in (("stiffness", K), ("mass", M)):
        entries = sp.coo_array(matrix)
        data |= {f"{name}_row": entries.row, f"{name}_column": entries.col, f"{name}_value": entries.data}
else:
    file = reader.Archive(path, parse_vtk=False)
    if np.any(file.node_angles):
        raise ValueError("nodes have axes of their own (NROTAT)")
    data = {"node": file.nnum, "position": file.nodes[:, :3]}
    data |= {"set " + name: numbers for name, numbers in file.node_components.items()}
np.savez(target, **data)
"""


def arrays(path: Path, where: str) -> dict[str, np.ndarray]:
    """Return the arrays that SCRIPT writes of a `.full` or `.cdb` file; raise InputError without the reader."""
    reader = None
    with suppress(ModuleNotFoundError):  # of a package above it
        reader = importlib.util.find_spec("ansys.mapdl.reader")
    if reader is None:
        problem = f"'{path.name}' is a file of Ansys, whose reader ansys-mapdl-reader is not installed"
        raise InputError(where, problem, "pip install 'flexclear[fe]'")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "arrays.npz"
        command = [
            sys.executable,
            "-c",
            SCRIPT,
            str(path.resolve()),
            str(target),
            # 4_000_000_000: addresses [bytes] that the reader's libraries take before any file
            str(4_000_000_000 + machine.available_memory()),
        ]
        # 300.0: longest time [s] for a file
        done = subprocess.run(command, capture_output=True, text=True, timeout=300.0, check=False)
        if not target.is_file():
            raise ValueError((done.stderr.strip().splitlines() or [f"its reader ended with {done.returncode}"])[-1])
        with np.load(target, allow_pickle=False) as data:
            return {name: data[name] for name in data.files}

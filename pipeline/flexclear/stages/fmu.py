"""FMUs for co-simulation: a scene, its bodies, and a C library that starts a process of this program.

FMI 2.0.4 and 3.0.2 (fmi-standard.org).  The motion is that of `fc.simulation`; `serve` is the process's side.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlparse
from xml.etree import ElementTree

from flexclear.artifacts.coordinates import AXES, QUATERNION
from flexclear.artifacts.disk import publish
from flexclear.artifacts.store import write_dataset
from flexclear.scene.load import number_in
from flexclear.scene.schema import Scene
from flexclear.stages import stepping
from flexclear.stages.workplace import Workplace
from flexclear.system.errors import FlexclearError, InputError
from flexclear.system.version import version as of_program

if TYPE_CHECKING:
    from flexclear.dynamics.stepwise import Simulation

#: versions of the standard, and the folder of binaries of each
VERSIONS = {"2": "linux64", "3": "x86_64-linux"}
SOURCE = Path(__file__).parent / "templates/fmu/fmu.c"
#: most outputs, and largest numbers of a scene, that an FMU lists
MOST = 10_000


@dataclass(frozen=True)
class Variable:
    """A variable of an FMU: its name, causality, unit, and start value, None for an output; quantity: that it reads."""

    name: str
    causality: str
    unit: str
    start: float | None = None
    quantity: str = ""


def write(scene: Scene, target: Path, asked: Mapping[str, Any], workplace: Workplace) -> str:
    """Write the FMU of a scene and return what it has; asked: `fmi`, the version, 3 by default.

    Raises FlexclearError.
    """
    standard = str(asked.get("fmi", "3")).removesuffix(".0")
    if standard not in VERSIONS:
        raise InputError(f"--fmi {standard}", "is no version of FMI that is written", f"known: {', '.join(VERSIONS)}")
    compiler = shutil.which("cc")
    if sys.platform != "linux" or compiler is None:
        raise InputError("--format fmu", "is written on Linux, with its C compiler cc", "install gcc or clang")
    params, inputs = stepping.parts(scene, workplace)
    with stepping.of_parts(params, inputs) as sim:
        listed = [Variable(name, "input", sim.inputs.unit(name), value) for name, value in sim.inputs.items()]
        listed += [*_parameters(params, sim), *_outputs(scene, sim)]
    names = [one.name for one in listed]
    if len(set(names)) < len(names) or len(names) > MOST:
        raise InputError("--format fmu", f"{len(names)} variables, some of the same name or too many", "watch fewer")
    content = json.dumps({"params": params, "variables": [vars(one) for one in listed]}, default=str)
    token = "{" + hashlib.sha256((standard + content).encode()).hexdigest()[:32] + "}"
    with tempfile.TemporaryDirectory() as folder:
        files = {"resources/scene.json": content.encode()}
        for name, data in inputs.items():
            write_dataset(Path(folder) / "body.nc", data)
            files[f"resources/{name.replace('/', '.')}.nc"] = (Path(folder) / "body.nc").read_bytes()
        identifier = re.sub(r"\W", "_", f"fmu_{scene.name}", flags=re.ASCII)
        binary = _compile_library(compiler, listed, token, standard, Path(folder))
        files[f"binaries/{VERSIONS[standard]}/{identifier}.so"] = binary
        files["modelDescription.xml"] = _model_description(scene, identifier, listed, token, standard)
        packed = Path(folder) / "packed"
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for name in sorted(files):  # without times, so that equal scenes give equal bytes
                archive.writestr(zipfile.ZipInfo(name), files[name], zipfile.ZIP_DEFLATED)
        publish(target, packed.read_bytes())
    counts = {kind: sum(one.causality == kind for one in listed) for kind in ("input", "parameter", "output")}
    said = ", ".join(f"{count} {kind}{'' if count == 1 else 's'}" for kind, count in counts.items())
    return f"wrote {target}: FMI {standard}.0, co-simulation, {said}; it runs with {sys.executable}"


def _parameters(params: Mapping[str, Any], sim: Simulation) -> Iterator[Variable]:
    """Yield the numbers of a scene whose change compiles nothing, except inputs, in the units of the scene."""
    from flexclear.dynamics.model.refill import KEYS

    inputs, table = {*sim.inputs}, params["scene"]
    for family in ("body", "joint", "load"):
        for part, keys in table.get(family, {}).items():
            for key in sorted(KEYS[family].split() & keys.keys()):
                for path in _leaves(keys[key], f"{family}.{part}.{key}"):
                    try:
                        value, unit = number_in(table, path, path)
                    except InputError:
                        continue
                    if path not in inputs and not path.endswith(".source") and "mesh" not in keys:
                        yield Variable(path, "parameter", unit, value)


def _leaves(value: Any, path: str) -> Iterator[str]:
    """Yield the paths of numbers, and of texts with units, at a path and below."""
    if isinstance(value, dict) and "type" not in value:
        for key, one in value.items():
            yield from _leaves(one, f"{path}.{key}")
    elif isinstance(value, (list, tuple)):
        for k, one in enumerate(value):
            yield from _leaves(one, f"{path}.{k}")
    elif isinstance(value, (int, float, str)) and not isinstance(value, bool):
        yield path


def _outputs(scene: Scene, sim: Simulation) -> Iterator[Variable]:
    for quantity in {one.name: one for one in scene.watched_quantities()}.values():
        if quantity.over_time:
            value = sim.read(quantity.name)
            ends = QUATERNION if quantity.dim == "quat" else AXES
            names = [quantity.name] if isinstance(value, float) else [f"{quantity.name}.{end}" for end in ends]
            for name in names:
                yield Variable(name, "output", quantity.unit, quantity=quantity.name)


def _compile_library(compiler: str, listed: list[Variable], token: str, standard: str, folder: Path) -> bytes:
    counts = [sum(one.causality == kind for one in listed) for kind in ("input", "parameter", "output")]
    starts = ", ".join(repr(one.start or 0.0) for one in listed)
    defined = [f"#define {name} {count}" for name, count in zip(("NU", "NP", "NY"), counts, strict=True)]
    texts = {"TOKEN": token, "PYTHON": sys.executable}
    defined += [f"#define {name} {json.dumps(text, ensure_ascii=False)}" for name, text in texts.items()]
    defined.append(f"static const double START[] = {{{starts}{', ' if starts else ''}0.0}};")
    (folder / "model.h").write_text("\n".join(defined) + "\n", encoding="utf-8", newline="\n")
    library = folder / "model.so"
    options = [f"-DFMI={standard}", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-w", f"-I{folder}"]
    done = subprocess.run([compiler, *options, str(SOURCE), "-o", str(library), "-lm"], capture_output=True, text=True)
    if done.returncode:
        raise InputError("--format fmu", f"{compiler} fails: {done.stderr.strip()[:500]}", "repair the C compiler")
    return library.read_bytes()


def _model_description(scene: Scene, identifier: str, listed: list[Variable], token: str, standard: str) -> bytes:
    """Return modelDescription.xml."""
    second, add = standard == "2", ElementTree.SubElement
    state, token_name = ("FMUstate", "guid") if second else ("FMUState", "instantiationToken")
    facts = {"fmiVersion": f"{standard}.0", "modelName": scene.title, token_name: token}
    facts |= {"generationTool": f"flexclear {of_program()}", "variableNamingConvention": "flat"}
    root = ElementTree.Element("fmiModelDescription", facts)
    able = ["needsExecutionTool", f"canGetAndSet{state}", f"canSerialize{state}"]
    able += ["canHandleVariableCommunicationStepSize", *(["canInterpolateInputs"] if second else [])]
    add(root, "CoSimulation", {"modelIdentifier": identifier} | dict.fromkeys(able, "true"))
    if units := sorted({one.unit for one in listed} - {""}):
        parent = add(root, "UnitDefinitions")
        for unit in units:
            add(parent, "Unit", {"name": unit})
    add(root, "DefaultExperiment", {"startTime": repr(scene.time.start), "stopTime": repr(scene.time.end)})
    variables = add(root, "ModelVariables")
    for k, one in enumerate(listed):
        fixed = {"variability": "fixed" if one.causality == "parameter" else "continuous"}
        common = {"name": one.name, "valueReference": str(k), "causality": one.causality, **fixed}
        typed = ({"unit": one.unit} if one.unit else {}) | ({} if one.start is None else {"start": repr(one.start)})
        if second:
            initial = {"output": "calculated", "parameter": "exact"}.get(one.causality)
            common |= {"initial": initial} if initial else {}
            add(add(variables, "ScalarVariable", common), "Real", typed)
        else:
            add(variables, "Float64", common | typed)
    if not second:
        when = {"name": "time", "valueReference": str(len(listed)), "causality": "independent"}
        add(variables, "Float64", when | {"variability": "continuous"})
    structure = add(root, "ModelStructure")
    outputs = [k for k, one in enumerate(listed) if one.causality == "output"]
    for kind in ("Output", "InitialUnknown") if outputs else ():
        parent = add(structure, f"{kind}s") if second else structure
        for k in outputs:
            add(parent, *(("Unknown", {"index": str(k + 1)}) if second else (kind, {"valueReference": str(k)})))
    ElementTree.indent(root)
    return ElementTree.tostring(root, "utf-8", xml_declaration=True)


# The process of an FMU -----------------------------------------------------------------------------------------------


def serve() -> None:
    """Answer the requests of an FMU's library (`templates/fmu/fmu.c`) on the socket that is this process's input."""
    link = socket.socket(fileno=0)
    stream, server = link.makefile("rwb"), None
    while True:
        try:
            if server is None:
                server = _Server(sys.argv[1])
                answer = b""
            else:
                letter = stream.read(1)
                if letter in (b"", b"Q"):
                    break
                answer = server.answer(letter, stream)
            stream.write(b"\0" + answer)
        except FlexclearError as error:
            text = str(error).encode()
            stream.write(b"\1" + struct.pack("=Q", len(text)) + text)
        stream.flush()
    os._exit(0)


class _Server:
    """The simulation of an FMU. where: its folder of resources, as a path or as a file's URI."""

    def __init__(self, where: str) -> None:
        from flexclear.artifacts import netcdf

        folder = Path(unquote(urlparse(where).path) if where.startswith("file:") else where)
        stored = json.loads((folder / "scene.json").read_text(encoding="utf-8"))
        self.params = stored["params"]
        self.bodies = {
            file.stem.replace(".", "/", 1): netcdf.read(file.read_bytes()) for file in sorted(folder.glob("*.nc"))
        }
        listed = [Variable(**one) for one in stored["variables"]]
        self.inputs, self.parameters, self.outputs = (
            [one for one in listed if one.causality == kind] for kind in ("input", "parameter", "output")
        )
        self.sim: Simulation | None = None

    def answer(self, letter: bytes, stream: Any) -> bytes:
        """Return the reply to a request."""
        sizes = {b"I": 2 + len(self.parameters) + len(self.inputs), b"A": 1 + 2 * len(self.inputs), b"S": 0, b"R": 0}
        numbers = struct.unpack(f"={sizes[letter]}d", stream.read(8 * sizes[letter]))
        if letter == b"I":
            self._begin(*numbers)
        if self.sim is None:
            raise InputError("FMU", "the motion has not begun", "leave the initialization mode first")
        if letter == b"A":
            count = len(self.inputs)
            self._set(numbers[1 : 1 + count], numbers[1 + count :], numbers[0])
            self.sim.advance(numbers[0])
        elif letter == b"S":
            state = self.sim.state
            return struct.pack("=Q", len(state)) + state
        elif letter == b"R":
            self.sim.state = stream.read(struct.unpack("=Q", stream.read(8))[0])
        return struct.pack(f"={len(self.outputs)}d", *self._read())

    def _begin(self, start: float, stop: float, *numbers: float) -> None:
        values, count = numbers, len(self.parameters)
        changes: dict[str, object] = {
            one.name: f"{value!r} {one.unit}" if one.unit else value
            for one, value in zip(self.parameters, values[:count], strict=True)
            if not math.isnan(value)
        }
        span = self.params["scene"]["time"]
        end = span.get("start", 0.0) + stop - start
        if end > span["end"]:
            changes["time.end"] = end
        self.sim = stepping.of_parts(self.params, self.bodies, changes)
        self._set(values[count:], (math.nan,) * len(self.inputs), 0.0)

    def _set(self, values: tuple[float, ...], rates: tuple[float, ...], duration: float) -> None:
        assert self.sim is not None
        for one, value, rate in zip(self.inputs, values, rates, strict=True):
            if not math.isnan(value):
                self.sim.inputs[one.name] = value if math.isnan(rate) else (value + rate * duration, rate)

    def _read(self) -> Iterator[float]:
        assert self.sim is not None
        for name in dict.fromkeys(one.quantity for one in self.outputs):
            value = self.sim.read(name)
            yield from [value] if isinstance(value, float) else value.tolist()

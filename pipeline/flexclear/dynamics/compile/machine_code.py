"""Machine code of one compiled function as bytes, which is loaded and called without the compiler.

Numba's own cache needs Numba, whose import takes longer than many runs. Stored here is the object file that Numba makes
of a function, with the function's name in it and the names that it refers to; LLVM alone loads it. Each function has an
execution engine of its own: names in the object file number functions of the process that compiled them, and those of
two processes may be equal.
"""

from __future__ import annotations

import hashlib
import json
import sys
from dataclasses import dataclass
from functools import cache
from typing import Any

from flexclear.dynamics.kernels import PLAIN

#: names that only the exits of functions refer to which raise Python exceptions; no kernel does, and reaching one ends
#: the process
NEVER_REACHED = {
    "NRT_Free",
    "NRT_MemInfo_call_dtor",
    "numba_do_raise",
    "numba_gil_ensure",
    "numba_gil_release",
    "numba_runtime_build_excinfo_struct",
    "numba_unpickle",
}


@dataclass(frozen=True)
class Code:
    """A C function: its address, 0 where none exists, and the object that keeps it in memory.

    image: of a function that Numba has not compiled.
    """

    address: int
    keeper: Any
    image: bytes = b""


#: image that stands for no function
NOTHING = b"{}\n"


def image(function: Any) -> bytes:
    """Return the code of a C function that Numba has compiled (`numba.cfunc`), for storage."""
    if PLAIN:
        return image_of_module(function.native_name, *assemble(function.inspect_llvm()))
    library = function._library  # private attributes of Numba, as those in `dynamics.lowering`
    return image_of_module(function.native_name, library._final_module, bytes(library._get_compiled_object()))


def image_of_module(name: str, module: Any, binary: bytes) -> bytes:
    """Return the image of a function, given by its name, LLVM's module and its object file."""
    foreign = [used.name for used in (*module.functions, *module.global_variables) if used.is_declaration]
    facts = {
        "name": name,
        "foreign": sorted(name for name in foreign if not name.startswith("llvm.")),
        "sha256": hashlib.sha256(binary).hexdigest(),
    }
    return json.dumps(facts, sort_keys=True).encode() + b"\n" + binary


def assemble(code: str, level: int = 3, *, optimised: bool = True) -> tuple[Any, bytes]:
    """Return LLVM's module of a text, and its object file for this processor.

    level: of optimisation for speed, 0 to 3.  optimised: True when the text is optimised already.
    """
    import llvmlite.binding as llvm

    module, features = llvm.parse_assembly(code), llvm.get_host_cpu_features().flatten()
    machine = _target().create_target_machine(llvm.get_host_cpu_name(), features, opt=level, jit=True)
    if level and not optimised:
        module.data_layout = str(machine.target_data)
        options = llvm.create_pipeline_tuning_options(level)
        options.loop_vectorization = options.slp_vectorization = False
        passes = llvm.create_pass_builder(machine, options)
        passes.getModulePassManager().run(module, passes)
    return module, bytes(machine.emit_object(module))


def load(stored: bytes) -> Code:
    """Return the function of an image from `image_of_module`; raise ValueError where it cannot be loaded."""
    import llvmlite.binding as llvm

    line, _, binary = stored.partition(b"\n")
    facts = json.loads(line)
    if not facts:
        return Code(0, None)
    if facts["sha256"] != hashlib.sha256(binary).hexdigest():  # LLVM ends the process over a damaged object file
        raise ValueError("names and code are not of one function")
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target().create_target_machine(jit=True))
    for name in facts["foreign"]:
        _register(llvm, name)
    engine.add_object_file(llvm.ObjectFileRef.from_data(binary))
    engine.finalize_object()
    address = engine.get_function_address(facts["name"])
    if not address:
        raise ValueError(f"no function {facts['name']}")
    return Code(address, engine)


@cache
def _target() -> Any:
    """Return LLVM's target: this processor."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    if not sys.platform.startswith("linux"):  # elsewhere Numba registers further functions
        _register_numba()
    return llvm.Target.from_default_triple()


def _register(llvm: Any, name: str) -> None:
    """Register a name that code refers to with LLVM, which would end the process over an unknown one."""
    if llvm.address_of_symbol(name):
        return
    if name in NEVER_REACHED:
        import ctypes

        llvm.add_symbol(name, ctypes.cast(ctypes.CDLL(None).abort, ctypes.c_void_p).value)
        return
    _register_numba()
    if not llvm.address_of_symbol(name):
        raise ValueError(f"{name} is not known")


@cache
def _register_numba() -> None:
    """Make Numba register its own functions with LLVM, as it does before it compiles."""
    from numba import cfunc

    cfunc("int64()")(lambda: 0)

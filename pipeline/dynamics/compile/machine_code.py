"""Machine code of one compiled function as bytes, and as something that can be called: without the compiler.

Numba's own cache needs Numba, which takes longer to import than many a run takes. What is stored here is the object
file that it makes of a function, with the name of the function in it and those of what it refers to; LLVM alone loads
that. Each has an engine of its own, so that names in it, which count functions of the process that compiled it, may be
those of others.
"""

from __future__ import annotations

import hashlib
import json
import sys
from dataclasses import dataclass
from functools import cache
from typing import Any

#: what only the ways out of functions refer to that raise exceptions of Python, which no kernel does; whoever goes
#: there all the same ends the process
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
    """A C function: where it is [address], 0 where there is none, and whatever keeps it there.

    image: of one that Numba has not compiled.
    """

    address: int
    keeper: Any
    image: bytes = b""


#: image of a function that there is not
NOTHING = b"{}\n"


def image(function: Any) -> bytes:
    """The code of a C function that Numba has compiled (`numba.cfunc`), for storage."""
    try:  # what Numba has made, where it keeps that in the release that this was written with
        module, binary = function._library._final_module, bytes(function._library._get_compiled_object())
    except (AttributeError, TypeError, ValueError, RuntimeError):
        module, binary = assembled(function.inspect_llvm())
    return stored(function.native_name, module, binary)


def stored(name: str, module: Any, binary: bytes) -> bytes:
    """The image of a function, given by its name, LLVM's module and its object file."""
    foreign = [used.name for used in (*module.functions, *module.global_variables) if used.is_declaration]
    facts = {
        "name": name,
        "foreign": sorted(name for name in foreign if not name.startswith("llvm.")),
        "sha256": hashlib.sha256(binary).hexdigest(),
    }
    return json.dumps(facts, sort_keys=True).encode() + b"\n" + binary


def assembled(code: str, level: int = 3, *, optimised: bool = True) -> tuple[Any, bytes]:
    """LLVM's module of a text, and its object file for this processor.

    level: of what is done for speed, 0 to 3.  optimised: whether the text is already.
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
    """The function of such an image; ValueError where it cannot be loaded."""
    import llvmlite.binding as llvm

    line, _, binary = stored.partition(b"\n")
    facts = json.loads(line)
    if not facts:
        return Code(0, None)
    if facts["sha256"] != hashlib.sha256(binary).hexdigest():  # LLVM does not outlive what is no object file
        raise ValueError("names and code are not of one function")
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target().create_target_machine(jit=True))
    for name in facts["foreign"]:
        _provide(llvm, name)
    engine.add_object_file(llvm.ObjectFileRef.from_data(binary))
    engine.finalize_object()
    address = engine.get_function_address(facts["name"])
    if not address:
        raise ValueError(f"no function {facts['name']}")
    return Code(address, engine)


@cache
def _target() -> Any:
    """What code is made for: this processor."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    if not sys.platform.startswith("linux"):  # elsewhere Numba knows what its code needs besides
        _ask_numba()
    return llvm.Target.from_default_triple()


def _provide(llvm: Any, name: str) -> None:
    """See that a name that code refers to is known: LLVM ends the process over one that is not."""
    if llvm.address_of_symbol(name):
        return
    if name in NEVER_REACHED:
        import ctypes

        llvm.add_symbol(name, ctypes.cast(ctypes.CDLL(None).abort, ctypes.c_void_p).value)
        return
    _ask_numba()
    if not llvm.address_of_symbol(name):
        raise ValueError(f"{name} is not known")


@cache
def _ask_numba() -> None:
    """Let Numba tell LLVM the functions of its own that code may call, as it does before it compiles."""
    from numba import cfunc

    cfunc("int64()")(lambda: 0)

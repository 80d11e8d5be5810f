"""Kernels become code without being optimised, so that what is called through n kernels is optimised once, and not n
times.

It needs parts of Numba that nobody promises to keep, and is taken where they do what they did (`works`), with releases
that it has been tested with; `kernels` says which. Else kernels are compiled as Numba does it: two to three times as
long, and just as right.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from types import ModuleType
from typing import Any, ClassVar

import llvmlite.binding as llvm
from numba import cfunc, njit, types
from numba.core.cgutils import normalize_ir_text
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.registry import cpu_target
from numba.core.typed_passes import NativeLowering


@contextmanager
def _taken_for_there(name: str) -> Iterator[None]:
    """Whoever asks meanwhile for a module has an empty one, and need not import it."""
    if name in sys.modules:
        yield
        return
    sys.modules[name] = ModuleType(name)
    try:
        yield
    finally:
        del sys.modules[name]


# Numba asks whether SciPy has a BLAS by importing SciPy's linear algebra, which takes as long as a dozen kernels
with _taken_for_there("scipy.linalg.cython_blas"):
    import numba.np.arraymath  # noqa: F401


class Part(JITCodeLibrary):
    """Unoptimised code of a kernel, and which libraries hold what it calls."""

    _whole: Any = None

    def add_ir_module(self, ir_module: Any) -> None:
        """The kernel's code, each function with its variables in registers; what it calls is declared only."""
        module = llvm.parse_assembly(normalize_ir_text(str(ir_module)))
        module.name, module.data_layout = ir_module.name, self._codegen._data_layout
        passes, builder = _function_passes()
        for function in module.functions:
            if not function.is_declaration:
                passes.run(function, builder)
        self._final_module = module

    def finalize(self) -> None:
        """Link, optimise and assemble nothing."""
        self._raise_if_finalized()
        for library in self._linking_libraries:
            self._reload_init.update(library._reload_init)
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """None: there is no machine code to point to."""
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> Part:
        """Receives the function's environment: this, which has nowhere to put it (`set_env`)."""
        return self

    def set_env(self, env_name: str, env: Any) -> None:
        """Needed to raise exceptions of Python, which no kernel does."""

    def _get_module_for_linking(self) -> Any:
        """Code of the kernel and of all that it calls."""
        if self._whole is None:
            whole = self._own().clone()
            for library in self._called():
                module = library._own() if isinstance(library, Part) else library._get_module_for_linking()
                whole.link_in(module, preserve=True)
            self._whole = whole
        return self._whole

    def _own(self) -> Any:
        return super()._get_module_for_linking()

    def _called(self) -> list[Any]:
        """Libraries of what it calls, directly or not, each once and after all that call it.

        The linker takes only what is referred to already: of a kernel that one caller names in code that never runs,
        and another one below calls, nothing would be there.
        """
        called: dict[Any, None] = {}
        open_calls = [(library, False) for library in self._linking_libraries]
        while open_calls:
            library, below_done = open_calls.pop()
            if below_done:
                called[library] = None
            elif library not in called:
                open_calls.append((library, True))
                below = library._linking_libraries if isinstance(library, Part) else []
                open_calls += [(other, False) for other in below if other not in called]
        return list(reversed(called))


class Whole(JITCodeLibrary):
    """Code of a function that Python calls, with all the kernels that it reaches: optimised for short loops.

    What goes over the bodies, closures or modes goes round a few times. As Numba has it, loops take several turns at
    once, in vectors: then most of the time goes to what is left over, and compiling takes twice as long.
    """

    def _optimize_final_module(self) -> None:
        """LLVM's passes; Numba's also look for references that are counted, of which there are none."""
        options = llvm.create_pipeline_tuning_options()
        options.speed_level = 3
        options.loop_vectorization = options.slp_vectorization = options.loop_unrolling = False
        passes = llvm.create_pass_builder(self._codegen._tm, options)
        passes.getModulePassManager().run(self._final_module, passes)


@cache
def _function_passes() -> Any:
    """What Numba lets run over each function before all others, made once instead of for each."""
    return cpu_target.target_context.codegen()._function_pass_manager()


@register_pass(mutates_CFG=True, analysis_only=False)
class PartLowering(NativeLowering):
    """Lowers a kernel into a `Part`."""

    _name = "part_lowering"
    library_class: type[JITCodeLibrary] = Part

    def run_pass(self, state: Any) -> bool:
        """As of any function, but for where its code goes."""
        state.library = self.library_class(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return bool(super().run_pass(state))


@register_pass(mutates_CFG=True, analysis_only=False)
class WholeLowering(PartLowering):
    """Lowers a function that Python calls into a `Whole`."""

    _name = "whole_lowering"
    library_class = Whole


#: passes for what no kernel has: comprehensions, blocks `with`, functions within functions, arrays as operands
NEEDLESS = {
    "WithLifting",
    "InlineClosureLikes",
    "InlineInlinables",
    "InlineOverloads",
    "RewriteDynamicRaises",
    "MakeFunctionToJitFunction",
    "FindLiterallyCalls",
    "LiteralUnroll",
    "LiteralPropagationSubPipelinePass",
    "NopythonRewrites",
    "NoPythonSupportedFeatureValidation",
    "DumpParforDiagnostics",
}


def _pipeline(state: Any, lowering: type[NativeLowering]) -> list[PassManager]:
    """Numba's pipeline with another lowering, less what kernels need not; there is no object mode to fall back to."""
    manager = PassManager(lowering.__name__)
    for step, what in DefaultPassBuilder.define_nopython_pipeline(state).passes:
        if step.__name__ not in NEEDLESS:
            manager.add_pass(lowering if step is NativeLowering else step, what)
    manager.finalize()
    return [manager]


#: types of what kernels compute with
PLAIN = (types.Number, types.Boolean, types.Literal, types.UniTuple, types.CPointer)


class Target:
    """Numba's context of code, as it was when the function that reaches the kernels began to be compiled.

    Looking through all registries for news before each kernel took a twentieth of the time.
    """

    def __init__(self, context: Any) -> None:
        self._context = context

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def refresh(self) -> None:
        """Nothing."""


class Typing(Target):
    """Numba's context of types, which remembers what operators and functions make of numbers.

    Numba tries all that is ever called `+`, arrays first, at each `+` anew.
    """

    types: ClassVar[dict[tuple[Any, Any], Any]] = {}

    def resolve_function_type(self, function: Any, arguments: Any, names: Any) -> Any:
        """Signature of a call; kernels are compiled for integers, not anew for each integer that is written out."""
        if isinstance(function, types.Dispatcher):
            return self._context.resolve_function_type(function, tuple(map(types.unliteral, arguments)), names)
        plain = not names and all(isinstance(kind, PLAIN) for kind in arguments)
        if not plain or not isinstance(function, types.Function):
            return self._context.resolve_function_type(function, arguments, names)
        if (function, arguments) not in self.types:
            self.types[function, arguments] = self._context.resolve_function_type(function, arguments, names)
        return self.types[function, arguments]


class KernelCompiler(CompilerBase):
    """Compiles a kernel into a `Part`."""

    def __init__(self, typing: Any, target: Any, *others: Any) -> None:
        super().__init__(Typing(typing), Target(target), *others)

    def define_pipelines(self) -> list[PassManager]:
        """The only one."""
        # h, f, w and n are four arrays: what is written into w changes nothing that was read from h
        self.state.flags.noalias = True
        return _pipeline(self.state, PartLowering)


class WholeCompiler(CompilerBase):
    """Compiles a function that Python calls into a `Whole`."""

    def define_pipelines(self) -> list[PassManager]:
        """The only one."""
        return _pipeline(self.state, WholeLowering)


def works() -> bool:
    """Whether a function of two kernels is compiled this way and gives what it should; raises what Numba raises."""
    compiled = njit(no_cfunc_wrapper=True, no_cpython_wrapper=True, _nrt=False, pipeline_class=KernelCompiler)
    inner = compiled(lambda x: x + 1.0)
    outer = compiled(lambda x: 2.0 * inner(x))
    whole = cfunc("float64(float64)", pipeline_class=WholeCompiler)(lambda x: outer(x) - inner(x))
    return bool(whole.ctypes(2.0) == 3.0)

"""Compilation of kernels without optimisation, so that code that is reached through n kernels is optimised once instead
of n times.

The module uses internals of Numba that may change, so the package requires tested releases of it (`pyproject.toml`).
Numba's own way takes two to three times as long, with equally correct results.
"""

from __future__ import annotations

from functools import cache
from typing import Any, ClassVar

import llvmlite.binding as llvm
from numba import types
from numba.core.cgutils import normalize_ir_text
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.registry import cpu_target
from numba.core.typed_passes import NativeLowering


class Part(JITCodeLibrary):
    """Unoptimised code of a kernel, and the libraries of the functions that it calls."""

    _whole: Any = None

    def add_ir_module(self, ir_module: Any) -> None:
        """Add the kernel's code, each function with its variables in registers; called functions are only declared."""
        module = llvm.parse_assembly(normalize_ir_text(str(ir_module)))
        module.name, module.data_layout = ir_module.name, self._codegen._data_layout
        passes, builder = _function_passes()
        for function in module.functions:
            if not function.is_declaration:
                passes.run(function, builder)
        self._final_module = module

    def finalize(self) -> None:
        """Finish without linking, optimising or assembling."""
        self._raise_if_finalized()
        for library in self._linking_libraries:
            self._reload_init.update(library._reload_init)
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0, which stands for no machine code."""
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> Part:
        """Receiver of the function's environment: this object, which ignores it (`set_env`)."""
        return self

    def set_env(self, env_name: str, env: Any) -> None:
        """Ignore the environment, which only raising Python exceptions needs; no kernel raises any."""

    def _get_module_for_linking(self) -> Any:
        """Return the code of the kernel and of all functions that it calls."""
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
        """Return the libraries of all functions called, directly or not, each once and after all their callers.

        The linker takes only functions referred to already: a kernel that one caller names in code that never runs,
        and a later one calls, would otherwise be missing.
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
    """Code of a function that Python calls, with all kernels that it reaches, optimised for short loops.

    Loops over bodies, closures or modes are short. By default Numba unrolls and vectorises loops:
    then the remainders take most of the time, and compiling takes twice as long.
    """

    def _optimize_final_module(self) -> None:
        """Run LLVM's passes; Numba's default also prunes reference counts, which kernels do not have."""
        options = llvm.create_pipeline_tuning_options()
        options.speed_level = 3
        options.loop_vectorization = options.slp_vectorization = options.loop_unrolling = False
        passes = llvm.create_pass_builder(self._codegen._tm, options)
        passes.getModulePassManager().run(self._final_module, passes)


@cache
def _function_passes() -> Any:
    """Return Numba's function passes, which run before all others; created once instead of for each function."""
    return cpu_target.target_context.codegen()._function_pass_manager()


@register_pass(mutates_CFG=True, analysis_only=False)
class PartLowering(NativeLowering):
    """Lowers a kernel into a `Part`."""

    _name = "part_lowering"
    library_class: type[JITCodeLibrary] = Part

    def run_pass(self, state: Any) -> bool:
        """Lower as for any function, but into this class of library."""
        state.library = self.library_class(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return bool(super().run_pass(state))


@register_pass(mutates_CFG=True, analysis_only=False)
class WholeLowering(PartLowering):
    """Lowers a function that Python calls into a `Whole`."""

    _name = "whole_lowering"
    library_class = Whole


#: passes for features that no kernel uses: comprehensions, `with` blocks, nested functions, arrays as operands
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
    """Return Numba's pipeline with another lowering, without object mode and passes that kernels do not need."""
    manager = PassManager(lowering.__name__)
    for step, what in DefaultPassBuilder.define_nopython_pipeline(state).passes:
        if step.__name__ not in NEEDLESS:
            manager.add_pass(lowering if step is NativeLowering else step, what)
    manager.finalize()
    return [manager]


#: types that kernels compute with
PLAIN = (types.Number, types.Boolean, types.Literal, types.UniTuple, types.CPointer)


class Target:
    """Numba's target context, frozen when the compilation of the function that reaches the kernels began.

    A refresh of all registries before each kernel took a twentieth of the time.
    """

    def __init__(self, context: Any) -> None:
        self._context = context

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def refresh(self) -> None:
        """Skip the refresh."""


class Typing(Target):
    """Numba's typing context, with a memory of the result types of operators and functions on numbers.

    Numba tries all overloads of `+`, arrays first, at each `+` again.
    """

    types: ClassVar[dict[tuple[Any, Any], Any]] = {}

    def resolve_function_type(self, function: Any, arguments: Any, names: Any) -> Any:
        """Return the signature of a call; kernels are compiled for the integer type, not for each literal integer."""
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
        """Return the only pipeline."""
        # h, f, w and n are four arrays: writes to w do not change values read from h
        self.state.flags.noalias = True
        return _pipeline(self.state, PartLowering)


class WholeCompiler(CompilerBase):
    """Compiles a function that Python calls into a `Whole`."""

    def define_pipelines(self) -> list[PassManager]:
        """Return the only pipeline."""
        return _pipeline(self.state, WholeLowering)

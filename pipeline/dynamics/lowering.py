"""A step of Numba's compiler in another form: kernels become code without being optimised, so that what is called
through n kernels is optimised once, and not n times.

It needs parts of Numba that nobody promises to keep, and is taken with releases that it has been looked at with;
`kernels` says which. With others kernels are compiled as Numba does it: longer, and just as right.
"""

from __future__ import annotations

from typing import Any, ClassVar

from numba import types
from numba.core import typed_passes as typed
from numba.core import untyped_passes as untyped
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.typed_passes import NativeLowering


class Part(JITCodeLibrary):
    """Unoptimised code of a kernel, and which libraries hold what it calls."""

    _whole: Any = None

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
        """Who is told where the function's environment is: this, which has nowhere to put it (`set_env`)."""
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
        found: dict[Any, None] = {}
        open_calls = [(library, False) for library in self._linking_libraries]
        while open_calls:
            library, below_done = open_calls.pop()
            if below_done:
                found[library] = None
            elif library not in found:
                open_calls.append((library, True))
                below = library._linking_libraries if isinstance(library, Part) else []
                open_calls += [(other, False) for other in below if other not in found]
        return list(reversed(found))


@register_pass(mutates_CFG=True, analysis_only=False)
class PartLowering(NativeLowering):
    """Lowers a function into a `Part`."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        """As of any function, but for where its code goes."""
        state.library = Part(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return bool(super().run_pass(state))


#: Numba's steps that kernels have a use for, in Numba's order. What is left out makes functions of comprehensions and
#: closures, fuses expressions of arrays, lifts loops and lists what could run in parallel: kernels have none of these,
#: and each step takes its time on each of some hundred kernels.
STEPS = (
    untyped.TranslateByteCode,
    untyped.FixupArgs,
    untyped.IRProcessing,
    untyped.RewriteSemanticConstants,
    untyped.DeadBranchPrune,
    untyped.GenericRewrites,
    untyped.ReconstructSSA,
    untyped.DeadBranchPrune,
    typed.NopythonTypeInference,
    typed.PreLowerStripPhis,
    typed.NoPythonSupportedFeatureValidation,
    typed.IRLegalization,
    typed.AnnotateTypes,
    PartLowering,
    typed.NoPythonBackend,
)


def _pipeline() -> PassManager:
    found = PassManager("kernel")
    for step in STEPS:
        found.add_pass(step, step._name)
    found.finalize()
    return found


PIPELINE = _pipeline()


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

    found: ClassVar[dict[tuple[Any, Any], Any]] = {}

    def resolve_function_type(self, function: Any, arguments: Any, names: Any) -> Any:
        """Signature of a call; kernels are compiled for integers, not anew for each integer that is written out."""
        if isinstance(function, types.Dispatcher):
            return self._context.resolve_function_type(function, tuple(map(types.unliteral, arguments)), names)
        plain = not names and all(isinstance(kind, PLAIN) for kind in arguments)
        if not plain or not isinstance(function, types.Function):
            return self._context.resolve_function_type(function, arguments, names)
        if (function, arguments) not in self.found:
            self.found[function, arguments] = self._context.resolve_function_type(function, arguments, names)
        return self.found[function, arguments]


class KernelCompiler(CompilerBase):
    """Numba's pipeline, less the steps that kernels have no use for, with `PartLowering`."""

    def __init__(self, typing: Any, target: Any, *others: Any) -> None:
        super().__init__(Typing(typing), Target(target), *others)

    def define_pipelines(self) -> list[PassManager]:
        """The only one; there is no object mode to fall back to."""
        return [PIPELINE]

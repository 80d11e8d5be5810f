"""A step of Numba's compiler in another form: kernels become code without being optimised, so that what is called
through n kernels is optimised once, and not n times.

It needs parts of Numba that nobody promises to keep, and is taken with releases that it has been tested with;
`kernels` says which. With others kernels are compiled as Numba does it: longer, and just as right.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from types import ModuleType
from typing import Any, ClassVar

import llvmlite.binding as llvm
from numba import types
from numba.core import ir
from numba.core import typed_passes as typed
from numba.core import untyped_passes as untyped
from numba.core.cgutils import normalize_ir_text
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, _pass_registry, register_pass
from numba.core.errors import TypingError
from numba.core.ir_utils import build_definitions
from numba.core.lowering import Lower
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.rewrites import rewrite_registry
from numba.core.sigutils import normalize_signature
from numba.core.ssa import reconstruct_ssa
from numba.core.transforms import canonicalize_cfg
from numba.core.typed_passes import NativeLowering
from numba.core.typeinfer import ConstraintNetwork, TypeInferer


@contextmanager
def _taken_for_there(name: str) -> Iterator[None]:
    """Whoever looks meanwhile whether there is a module, finds one, and need not import it."""
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
class Flow(untyped.IRProcessing):
    """Loops have one way back."""

    _name = "flow"

    def run_pass(self, state: Any) -> bool:
        """What lives how long is of interest at the end only (`IRLegalization`); Numba finds it five times over."""
        state.func_ir.blocks = canonicalize_cfg(state.func_ir.blocks)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class Rewrites(untyped.GenericRewrites):
    """Indices, powers and the like that are written out are distinguished from those that are computed."""

    _name = "rewrites"

    def run_pass(self, state: Any) -> bool:
        """Each rewriting of each block until it finds nothing more."""
        blocks = state.func_ir.blocks
        for kind in rewrite_registry.rewrites["before-inference"]:
            rewrite, left = kind(state), list(blocks)
            while left:
                block = left.pop()
                if rewrite.match(state.func_ir, blocks[block], state.typemap, state.calltypes):
                    blocks[block] = rewrite.apply()
                    left.append(block)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class Versions(untyped.ReconstructSSA):
    """A variable that is assigned more than once becomes several."""

    _name = "versions"

    def run_pass(self, state: Any) -> bool:
        """As of any function."""
        state.func_ir = reconstruct_ssa(state.func_ir)
        state.func_ir._definitions = build_definitions(state.func_ir.blocks)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class Joins(typed.PreLowerStripPhis):
    """Where ways meet, a variable has its value from the way that was taken."""

    _name = "joins"

    def run_pass(self, state: Any) -> bool:
        """As of any function."""
        state.func_ir = self._strip_phi_nodes(state.func_ir)
        state.func_ir._definitions = build_definitions(state.func_ir.blocks)
        return True


class Constraints(ConstraintNetwork):
    """What follows for the types of variables; what Numba would warn of does not occur between numbers."""

    def propagate(self, infer: Any) -> list[Exception]:
        """Errors, which may be for want of a type that is found later."""
        errors: list[Exception] = []
        for constraint in self.constraints:
            try:
                constraint(infer)
            except TypingError as error:
                errors.append(error)
        return errors


@register_pass(mutates_CFG=True, analysis_only=False)
class KernelTypes(typed.NopythonTypeInference):
    """Types of a kernel's variables."""

    _name = "kernel_types"

    def run_pass(self, state: Any) -> bool:
        """As of any function, but for the warnings that nobody waits for."""
        context, code = state.typingctx, state.func_ir
        infer = TypeInferer(context, code, None)
        infer.constraints = Constraints()
        with context.callstack.register(state.targetctx.target, infer, code.func_id, state.args):
            for index, (name, kind) in enumerate(zip(code.arg_names, state.args, strict=True)):
                infer.seed_argument(name, index, kind)
            infer.build_constraint()
            infer.propagate()
            state.typemap, state.return_type, state.calltypes = infer.unify()
        return True


class KernelLower(Lower):
    """Numba's lowering without the words for messages that it forms at each statement."""

    def lower_block(self, block: Any) -> None:
        """Statement by statement."""
        self.pre_block(block)
        for statement in block.body:
            self.loc = statement.loc
            self.lower_inst(statement)
        self.post_block(block)

    def lower_inst(self, statement: Any) -> None:
        """Most assign a value, or say that one is not needed any more."""
        if isinstance(statement, ir.Assign):
            name, value = statement.target.name, statement.value
            argument = value.index + 1 if isinstance(value, ir.Arg) else None
            self.storevar(self.lower_assign(self.typeof(name), statement), name, argidx=argument)
        elif isinstance(statement, ir.Del):
            self.delvar(statement.value)
        else:
            super().lower_inst(statement)


@register_pass(mutates_CFG=True, analysis_only=False)
class PartLowering(NativeLowering):
    """Lowers a kernel into a `Part`."""

    _name = "part_lowering"
    lowering_class = KernelLower
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


#: Numba's steps that kernels have a use for, in Numba's order. What is left out makes functions of comprehensions and
#: closures, fuses expressions of arrays, lifts loops and lists what could run in parallel: kernels have none of these,
#: and each step takes its time on each of some hundred kernels.
STEPS = (
    untyped.TranslateByteCode,
    untyped.FixupArgs,
    Flow,
    untyped.RewriteSemanticConstants,
    untyped.DeadBranchPrune,
    Rewrites,
    Versions,
    untyped.DeadBranchPrune,
    KernelTypes,
    Joins,
    typed.NoPythonSupportedFeatureValidation,
    typed.IRLegalization,
    typed.AnnotateTypes,
    PartLowering,
    typed.NoPythonBackend,
)


class Steps(PassManager):
    """One after another; Numba's own manager works the flow of control out again after each."""

    def run(self, state: Any) -> None:
        """All of them."""
        for step, _ in self.passes:
            _pass_registry.get(step).pass_inst.run_pass(state)


def _pipeline() -> Steps:
    steps = Steps("kernel")
    for step in STEPS:
        steps.add_pass(step, step._name)
    steps.finalize()
    return steps


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


class KernelDispatcher(CPUDispatcher):
    """Compiles a kernel by the types of its arguments; nobody listens how long that takes."""

    @classmethod
    def of(cls, function: Any, options: Mapping[str, Any]) -> KernelDispatcher:
        """What compiles a function; options: as `numba.njit` has them."""
        return cls(
            function, targetoptions={"nopython": True, "boundscheck": None, **options}, pipeline_class=KernelCompiler
        )

    def compile(self, sig: Any) -> Any:
        """Entry point of what has been compiled for these types."""
        arguments, returned = normalize_signature(sig)
        overload = self.overloads.get(tuple(arguments))
        if overload is None:
            with self._compiling_counter:
                overload = self._compiler.compile(arguments, returned)
                self.add_overload(overload)
        return overload.entry_point


class KernelCompiler(CompilerBase):
    """Numba's pipeline, less the steps that kernels have no use for, with `PartLowering`."""

    def __init__(self, typing: Any, target: Any, *others: Any) -> None:
        super().__init__(Typing(typing), Target(target), *others)
        # h, f, w and n are four arrays: what is written into w changes nothing that was read from h
        self.state.flags.noalias = True

    def define_pipelines(self) -> list[PassManager]:
        """The only one; there is no object mode to fall back to."""
        return [PIPELINE]


class WholeCompiler(CompilerBase):
    """Numba's pipeline with `WholeLowering`."""

    def define_pipelines(self) -> list[PassManager]:
        """The only one."""
        manager = PassManager("whole")
        for step, what in DefaultPassBuilder.define_nopython_pipeline(self.state).passes:
            manager.add_pass(WholeLowering if step is NativeLowering else step, what)
        manager.finalize()
        return [manager]

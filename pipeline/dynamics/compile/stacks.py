"""Functions that run on stacks of their own, and stop in the middle to be continued later.

A stepper that needs an evaluation is stopped there, and continues when the evaluation has been made, next to those that
other steppers wait for (`compile.lanes`). It knows nothing of that: it calls the right-hand side by its address, and at
that address there is `wait`. To stop is to store the registers that a function must leave as they were, and to continue
with another stack: some nanoseconds.

Each stack begins with a record; a function finds its own by its stack pointer, since stacks begin at multiples of their
size. Kernels neither recurse nor have arrays on the stack; they come nowhere close to its end, and what lies between is
guarded: to touch it ends the process.

Source: System V Application Binary Interface, AMD64 Architecture Processor Supplement, sec. 3.2 (registers, arguments).
"""

from __future__ import annotations

import mmap
import platform
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

#: of a stack [bytes]
SIZE = 1 << 20
#: words of a record: stack pointers of the function and of who lets it run; its state; the arguments of the evaluation
#: that it waits for (h, f, w, n, y, dy, t); its address and arguments (h, f, w, n, t, then nine integers and places)
POINTER, BACK, STATE, GIVEN, TIME, FUNCTION, ARGUMENTS = 0, 1, 2, 3, 9, 10, 11
#: states: it may continue, it waits for an evaluation, it has come back, there is none
READY, WAITING, DONE, IDLE = 0, 1, 2, 3
#: where Linux reports on this process
STATUS = Path("/proc/self/status")
#: of mprotect, on every Linux
NO_ACCESS = 0
#: words of a group's table: whether its thread shall return, the address of what evaluates one state or 0, and the
#: first of the addresses of its records
WANTED, ALONE, HEAD = 0, 1, 2
#: words of a record, and those that a stack holds before its function has begun
RECORD, BEGIN = 32, 9
_SAVED = ("rbp", "rbx", "r12", "r13", "r14", "r15")
_KEEP = [f"pushq %{name}" for name in _SAVED]
_GO_ON = [*(f"popq %{name}" for name in reversed(_SAVED)), "xorl %eax, %eax", "ret"]
_RECORD = f"andq $${-SIZE}, "
#: an evaluation's address, called by the stepper with (h, f, w, n, t, y, dy)
_WAIT = [
    *_KEEP,
    "movq %rsp, %rax",
    f"{_RECORD}%rax",
    *(f"movq %{name}, {8 * (GIVEN + k)}(%rax)" for k, name in enumerate(("rdi", "rsi", "rdx", "rcx", "r8", "r9"))),
    f"movsd %xmm0, {8 * TIME}(%rax)",
    f"movq $${WAITING}, {8 * STATE}(%rax)",
    f"movq %rsp, {8 * POINTER}(%rax)",
    f"movq {8 * BACK}(%rax), %rsp",
    *_GO_ON,
]
#: called with a record: its function continues, and this returns when that waits or has come back
_RESUME = [*_KEEP, f"movq %rsp, {8 * BACK}(%rdi)", f"movq {8 * POINTER}(%rdi), %rsp", *_GO_ON]
#: where a function begins: a call with the arguments in its record
_START = [
    "movq %rsp, %rbx",
    f"{_RECORD}%rbx",
    "subq $$8, %rsp",  # with seven words after it a call finds the stack as it must be: a multiple of 16 bytes
    *(f"pushq {8 * (ARGUMENTS + k)}(%rbx)" for k in range(13, 6, -1)),
    *(
        f"movq {8 * (ARGUMENTS + k)}(%rbx), %{name}"
        for k, name in ((0, "rdi"), (1, "rsi"), (2, "rdx"), (3, "rcx"), (5, "r8"), (6, "r9"))
    ),
    f"movsd {8 * (ARGUMENTS + 4)}(%rbx), %xmm0",
    f"call *{8 * FUNCTION}(%rbx)",
    f"movq $${DONE}, {8 * STATE}(%rbx)",
    f"movq {8 * BACK}(%rbx), %rsp",
    *_GO_ON,
]
_CODE = {"wait": _WAIT, "resume": _RESUME, "start": _START}


def supported() -> bool:
    """Whether there is code for this processor and system, and it may be used here."""
    return sys.platform.startswith("linux") and platform.machine() == "x86_64" and not shadowed(STATUS)


def shadowed(status: Path) -> bool:
    """Whether the processor keeps a second stack of return addresses, next to which no other stack may be continued.

    status: the system's text about a process.
    """
    try:
        status_text = status.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    return any(line.startswith("x86_Thread_features:") and "shstk" in line.split() for line in status_text.splitlines())


@cache
def addresses() -> dict[str, int]:
    """Addresses of `wait`, `resume` and `start`."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    llvm.initialize_native_asmparser()
    module = llvm.parse_assembly("\n".join(_function(name, lines) for name, lines in _CODE.items()))
    target = llvm.Target.from_default_triple().create_target_machine(jit=True)
    engine = llvm.create_mcjit_compiler(module, target)
    engine.finalize_object()
    _kept.append(engine)
    return {name: engine.get_function_address(f"flexclear_{name}") for name in _CODE}


#: what keeps the code where it is
_kept: list[Any] = []


def _function(name: str, lines: list[str]) -> str:
    code = "\\0A".join(lines)
    head = f"define void @flexclear_{name}() naked noinline nounwind"
    return f'{head} {{\n  call void asm sideeffect "{code}", ""()\n  unreachable\n}}'


def _guard(page: int) -> None:
    """Let nobody touch a page of memory."""
    import ctypes

    protect = ctypes.CDLL(None, use_errno=True).mprotect
    protect.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)
    if protect(page, mmap.PAGESIZE, NO_ACCESS):
        raise OSError(ctypes.get_errno(), "a page of memory cannot be guarded")


class Stacks:
    """Room for functions to run on; records: one per stack, not copied, shape (number, RECORD)."""

    def __init__(self, number: int) -> None:
        self._memory = mmap.mmap(-1, (number + 1) * SIZE)
        whole = np.frombuffer(self._memory, np.int64)
        first = -whole.ctypes.data % SIZE // 8
        for k in range(number):
            _guard(whole.ctypes.data + 8 * first + k * SIZE + mmap.PAGESIZE)
        self._words = whole[first : first + number * SIZE // 8].reshape(number, -1)
        self.records = self._words[:, :RECORD]
        self.records[:, STATE] = IDLE

    def begin(self, k: int, function: int, arguments: Sequence[int]) -> None:
        """Let stack k run a function, by its address and that of all its arguments, from the next `resume` on."""
        top = self._words[k, -BEGIN:]
        top[:] = 0
        top[len(_SAVED)] = addresses()["start"]
        record = self.records[k]
        record[POINTER] = top.ctypes.data
        record[FUNCTION], record[ARGUMENTS : ARGUMENTS + len(arguments)] = function, arguments
        record[STATE] = READY

"""Kernels of expressions (`core.scene.formulas`): one line per operation, without numbers in the code."""

from __future__ import annotations

from flexclear.dynamics.loads.lookup import length
from flexclear.scene.expression import BENT, fold
from flexclear.scene.formulas import VECTORS, operands

#: code of operations on numbers
FORMS = {"+": "{} + {}", "-": "{} - {}", "*": "{} * {}", "/": "{} / {}", "^": "{} ** {}", "minus": "-{}"}
FORMS |= {name: f"looks.np.{name}({{}})" for name in ("sqrt", "sin", "cos", "tan", "exp", "log", "tanh")}
#: kernel of `loads.looks` that reads a leaf of this letter
READERS = {"c": "constant", "p": "position", "v": "velocity", "o": "omega", "q": "coordinate", "r": "coordinate_rate"}
#: code of leaves without an index
UNINDEXED = {"t": "looks.law(d, k, 0)", "l": "looks.line(d, k)[0]", "s": "looks.line(d, k)[1]"}


class Lines:
    """Lines of a kernel, each of which assigns a value to a name; equal values have one name."""

    def __init__(self, code: str) -> None:
        self.lines: dict[str, str] = {}
        self.bends, tokens = 0, code.split()
        # the numbers of the tables follow the origin and the expressions' own
        self.first, end = (
            dict[str, int](),
            3 + len({token for token in tokens if token[0] == "c" and token[1:].isdigit()}),
        )
        for token in sorted({one for one in tokens if ":" in one}, key=lambda one: int(one[1:].partition(":")[0])):
            self.first[token] = end
            end += length(_levels(token))

    def name(self, text: str) -> str:
        """Return the name of a value."""
        return self.lines.setdefault(text, f"x{len(self.lines)}")

    def function(self, name: str, result: str) -> str:
        """Return the source of the function name(d, k) with these lines."""
        body = "".join(f"    {name} = {text}\n" for text, name in self.lines.items())
        return f"def {name}(d, k):\n{body}    return {result}\n"

    def leaf(self, token: str) -> tuple[str, bool]:
        """Return the name of a leaf's value, and True for a vector."""
        if token in UNINDEXED:
            return self.name(UNINDEXED[token]), False
        read, _, component = token.partition(".")
        one = self.name(f"looks.{READERS[read[0]]}(d, k, {read[1:]})")
        return (self.name(f"{one}[{'xyz'.index(component)}]"), False) if component else (one, read[0] in VECTORS)

    def apply(self, token: str, values: list[tuple[str, bool]]) -> tuple[str, bool]:
        """Return the name of an operation's result, and True for a vector."""
        names, vectors = [name for name, _ in values], [vector for _, vector in values]
        if token in self.first:
            levels = _levels(token)
            given = ", ".join(map(str, [self.first[token], *levels, *names]))
            return self.name(f"looks.{'curve' if len(levels) == 1 else 'surface'}(d, k, {given})"), False
        if token == "norm":
            return self.name(
                f"looks.np.sqrt(looks.dot({names[0]}, {names[0]}))" if vectors[0] else f"abs({names[0]})"
            ), (False)
        if any(vectors):
            return self.name(_vector(token, names, vectors)), True
        if token in BENT:
            watched = self.name(FORMS["-"].format(*names)) if len(names) == 2 else names[0]
            self.name(f"looks.note(d, k, {self.bends}, {watched})")
            self.bends += 1
            return self.name(f"{token}({', '.join(names)})"), False
        if token[0] == "^" and len(token) > 1:
            product = " * ".join(names * abs(int(token[1:])))
            return self.name(product if int(token[1:]) > 0 else f"1.0 / ({product})"), False
        return self.name(FORMS[token].format(*names)), False


def _levels(token: str) -> tuple[int, ...]:
    return tuple(map(int, token.split(":")[1:]))


def _vector(token: str, names: list[str], vectors: list[bool]) -> str:
    first, last = names[0], names[-1]
    if token in "+-":
        return f"looks.{'add' if token == '+' else 'sub'}({first}, {last})"
    if token == "*":
        return f"looks.scale({last}, {first})" if vectors[0] else f"looks.scale({first}, {last})"
    return f"looks.scale({'-1.0' if token == 'minus' else f'1.0 / {last}'}, {first})"


def source(name: str, code: str) -> str:
    """Return the source of the kernel name(d, k): the number, or the vector of three, that load k computes."""
    lines = Lines(code)
    values = [fold(part.split(), lines.leaf, lines.apply, operands)[0] for part in code.split(" ; ")]
    result = values[0] if len(values) == 1 else f"({', '.join(values)})"
    return f"@kernel\n{lines.function(name, result)}"


def looked_up(code: str) -> str:
    """Return the source of the function looked_up(d, k): number of a table, and the values at which load k looks it up,
    for each place in its expressions."""
    lines, found = Lines(code), list[str]()

    def apply(token: str, values: list[tuple[str, bool]]) -> tuple[str, bool]:
        if token in lines.first:
            found.append(f"({token[1:].partition(':')[0]}, ({', '.join(name for name, _ in values)},))")
        return lines.apply(token, values)

    for part in code.split(" ; "):
        fold(part.split(), lines.leaf, apply, operands)
    return lines.function("looked_up", f"[{', '.join(found)}]")

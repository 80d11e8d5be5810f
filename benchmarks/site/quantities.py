"""docs/reference/quantities.md: every quantity that can be watched, compared, kept, planned, filmed and asked for."""

from __future__ import annotations

from benchmarks.site.keys import table
from flexclear.pipeline.core.scene.quantity import CONTACT_REDUCTIONS, KINDS, OWNERS, SERIES, WORDS, Kind

HEAD = """# Quantities

What a run holds over time has a name. The same name is watched (`[view] watch`), compared, planned, filmed,
asked for in `[accuracy]` and read from a run. Sweeps record it with a reduction behind it (`keep`), also once in each
period:

```python
import flexclear as fc

run = fc.run("slider_crank.toml")
fc.quantity(run, "slider.acceleration.x")  # over time, with its unit
fc.quantity(run, "force(pin) - force(main)")
```

- `<owner>.<word>` as in `slider.position`; `slider.position.x` is a component along x, y or z of the world.
- Where a part is a body and a joint at the same time, the word means the first of the owners below that has it.
  The second word of the table says which one is meant: `guide.joint_position`.
- `force(A1)` is another way to write `A1.force`.
- What belongs to the whole mechanism has no owner: `kinetic`.
- Expressions have `+ - * / ^`, parentheses, numbers with units, the time `t` and the functions `max`, `min`, `abs`,
  `sqrt`, `sin`, `cos`, `tan`, `exp`, `log`, `sign`, `step` (1 from zero on) and `norm`, the magnitude, with spaces
  around + and -: `max(0, slider.position.x - 10 mm)^1.5`. Units are checked; a bare 0 fits every unit.
  As keys of `[accuracy]` they are quoted.
- A relative accuracy refers to the largest change since the start (lengths and angles) or to the largest magnitude (all
  others). An absolute one has the unit of the quantity.

This page is written from the schema of runs (`python -m benchmarks.site`).

"""


def text() -> str:
    """The page."""
    parts = [HEAD]
    for dim, owner in OWNERS.items():
        rows = [
            (", ".join(f"`{word}`" for word in _words(key)), " or ".join(dict.fromkeys(kind.units)), _meaning(kind))
            for key, kind in KINDS.items()
            if kind.owner == dim and kind.variable
        ]
        parts.append(f"## {owner[0].upper()}{owner[1:]}\n\n{table(('word', 'unit', 'meaning'), rows)}\n\n")
    reductions = [(f"`{name}`", meaning) for name, meaning in SERIES.items()]
    of_contacts = [
        (f"`{kind}.{name}`", meaning) for kind, few in CONTACT_REDUCTIONS.items() for name, meaning in few.items()
    ]
    parts.append(f"## Reductions, of sweeps\n\n{table(('name', 'meaning'), reductions + of_contacts)}\n")
    return "".join(parts)


def _words(key: str) -> list[str]:
    return sorted((word for word, keys in WORDS.items() if key in keys), key=lambda word: (len(word), word))


def _meaning(kind: Kind) -> str:
    parts = {"axis": "; x, y, z", "quat": "; a rotation, in radians"}
    most = "; of all sections the one where it is largest" if kind.owner == "section" else ""
    return f"{kind.meaning}{parts.get(kind.dim, '')}{most}"

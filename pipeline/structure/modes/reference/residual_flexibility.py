"""Free-interface normal modes and residual attachment modes, in mean axes, with the residual mass.

A residual attachment mode is what the retained normal modes miss of the answer to a unit load at an interface; it is
orthogonal to them. The space is Craig and Chang's; the shapes stay independent however many normal modes are retained.
Source: MacNeal (1971), Computers & Structures 1, 581-601; Rubin (1975), AIAA Journal 13, 995-1006.
"""

from __future__ import annotations

from dataclasses import replace

from flexclear.pipeline.structure.fe.model import Model
from flexclear.pipeline.structure.modes.condition import Condition, Given
from flexclear.pipeline.structure.modes.reference import craig_chang


def condition(model: Model, given: Given) -> Condition:
    """Six residual attachment modes per interface and normal modes of the free body; InputError without interfaces."""
    return replace(craig_chang.condition(model, given), residual=True)

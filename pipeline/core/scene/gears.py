"""Gears and racks: joint coordinates that follow each other."""

from typing import Self

from pydantic import model_validator

from flexclear.pipeline.core.scene.fields import Part
from flexclear.pipeline.core.scene.laws import Value


class Gear(Part):
    """A joint coordinate that follows another one: change of `second` = ratio times change of `first`.

    first, second: joints (``A``), with the coordinate where there are several (``A.rotation``).
    ratio: a number; of a slide that follows an angle a length per angle ("10 mm/rad"), and the other way round.
    """

    first: str
    second: str
    ratio: Value

    @model_validator(mode="after")
    def _two(self) -> Self:
        if self.first == self.second:
            raise ValueError(f"a gear couples two coordinates; first and second are both '{self.first}'")
        return self

"""List of all effects, in the order of their blocks in the ledger. To add one: its folder, and its lines here.

Only declarations are imported (`effects.effect`).
"""

from __future__ import annotations

from flexclear.pipeline.dynamics.effects.bushings.effect import BUSHINGS
from flexclear.pipeline.dynamics.effects.controllers.effect import CONTROLLERS
from flexclear.pipeline.dynamics.effects.gears.effect import GEARS
from flexclear.pipeline.dynamics.effects.joint_friction.effect import JOINT_FRICTION
from flexclear.pipeline.dynamics.effects.stiffening.effect import STIFFENING
from flexclear.pipeline.dynamics.effects.stops.effect import STOPS
from flexclear.pipeline.dynamics.effects.wear.effect import WEAR

EFFECTS = (STIFFENING, STOPS, GEARS, BUSHINGS, CONTROLLERS, JOINT_FRICTION, WEAR)

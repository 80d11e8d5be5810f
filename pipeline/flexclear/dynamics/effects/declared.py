"""List of all effects, in the order of their blocks in the ledger. To add one: its folder, and its lines here.

Only declarations are imported (`effects.effect`).
"""

from __future__ import annotations

from flexclear.dynamics.effects.bushings.effect import BUSHINGS
from flexclear.dynamics.effects.controllers.effect import CONTROLLERS
from flexclear.dynamics.effects.gears.effect import GEARS
from flexclear.dynamics.effects.joint_friction.effect import JOINT_FRICTION
from flexclear.dynamics.effects.stiffening.effect import STIFFENING
from flexclear.dynamics.effects.stops.effect import STOPS
from flexclear.dynamics.effects.wear.effect import WEAR

EFFECTS = (STIFFENING, STOPS, GEARS, BUSHINGS, CONTROLLERS, JOINT_FRICTION, WEAR)

"""List of all effects, in the order of their blocks in the ledger. To add one: its folder, and its lines here.

Only declarations are imported (`effects.effect`).
"""

from __future__ import annotations

from flexclear.dynamics.effects.bushings import BUSHINGS
from flexclear.dynamics.effects.controllers import CONTROLLERS
from flexclear.dynamics.effects.films import FILMS
from flexclear.dynamics.effects.gears import GEARS
from flexclear.dynamics.effects.joint_friction import JOINT_FRICTION
from flexclear.dynamics.effects.stiffening import STIFFENING
from flexclear.dynamics.effects.stops import STOPS
from flexclear.dynamics.effects.wear import WEAR

EFFECTS = (STIFFENING, STOPS, GEARS, BUSHINGS, CONTROLLERS, FILMS, JOINT_FRICTION, WEAR)

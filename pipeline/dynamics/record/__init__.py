"""From observed rows to the run dataset: named bodies, frames, joints, contacts, energies.

What is recorded only where a scene's ``[output]`` asks for it is a module called like its key there, which
core/scene/output declares together with the variables that it adds. The module has
``record(motions, asked)``, which returns them and their coordinates; asked is the key's value.
"""

from flexclear.pipeline.core.scene.output import VARIABLES

KIND = "record on request"
NAMES = {name: f"{name}:record" for name in VARIABLES}

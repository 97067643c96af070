"""A scenario as read: records whose values are final (parameters resolved, references checked).

Metres, seconds, radians; names and enumeration values as in ASAM OpenSCENARIO XML 1.3. Records that are
read as they stand in the file declare their attributes and children (see `elements`).
"""

from scenarios.openscenario.model.actions import *  # noqa: F403
from scenarios.openscenario.model.conditions import *  # noqa: F403
from scenarios.openscenario.model.entities import *  # noqa: F403
from scenarios.openscenario.model.positions import *  # noqa: F403
from scenarios.openscenario.model.storyboard import *  # noqa: F403

"""Records of an OpenDRIVE file, as read, in SI units and radians.

Nothing here is computed: positions, borders and topology are derived in the other modules. Ids are strings,
as in the standard. A piecewise cubic is an array of shape (K, 5) with the columns ``s, a, b, c, d``: from
``s`` on, the value is ``a + b ds + c ds^2 + d ds^3``. `extra` holds the XML text of elements that have no
record, such as user data. Clauses refer to ASAM OpenDRIVE 1.8.
"""

from opendrive.model.curves import *  # noqa: F403
from opendrive.model.deferred import *  # noqa: F403
from opendrive.model.junctions import *  # noqa: F403
from opendrive.model.lanes import *  # noqa: F403
from opendrive.model.map import *  # noqa: F403
from opendrive.model.objects import *  # noqa: F403
from opendrive.model.railroads import *  # noqa: F403
from opendrive.model.roads import *  # noqa: F403
from opendrive.model.signals import *  # noqa: F403

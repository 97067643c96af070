"""The command by `python -m smartmot`."""

import sys

if not sys.flags.safe_path:
    # `-m` puts the current folder first, where anything of the user's may have a name that Python knows
    sys.path.append(sys.path.pop(0))

from _smartmot import main

main()

"""The command line of the studies: `python tests/bench/studies STUDY …`."""

import sys
from pathlib import Path

if __name__ == "__main__":
    # Python puts this folder first; its modules are found as `studies.NAME`.
    sys.path[0] = str(Path(__file__).resolve().parents[1])
    from studies.command import main
    from zteam.node.leaving import leave

    leave(main())

"""Makes the tests' own modules importable, in xdist workers too, and keeps compiled kernels in one place."""

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

# pytester gives the runs it starts a home of their own, where the simulator would compile its kernels once more.
os.environ.setdefault("XDG_CACHE_HOME", str(Path.home() / ".cache"))

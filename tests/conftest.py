"""Makes the tests' own modules importable, in xdist workers too."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

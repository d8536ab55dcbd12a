"""Studies of whole teams: `python tests/bench/studies STUDY …` (docs/benchmarks.md)."""

import os
from pathlib import Path

# Robots of a study have classes from here, and import them by name in their own processes.
_FOLDER = str(Path(__file__).resolve().parents[1])
if _FOLDER not in os.environ.get("PYTHONPATH", "").split(os.pathsep):
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [_FOLDER, os.environ.get("PYTHONPATH")]))

"""What was recorded from Stage and tf2: a small set in `data`, and the full sets where `../shared` is at hand.

The worlds of the small set are zteam's own. Tests judge with the small set everywhere, and with the full sets too
where they are.
"""

import functools
import gzip
import json
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared"
DATA = ROOT / "tests" / "golden" / "data"
WORLDS = ROOT / "tests" / "golden" / "worlds"
"""Small world files of zteam's own, one for a feature of the language."""

SETS = ["own", "full"] if SHARED.is_dir() else ["own"]
"""The sets that are here: a parameter of every test that judges with them."""


@functools.lru_cache(4)
def _read(path: Path) -> Any:
    with gzip.open(path) as file:
        return json.load(file)


def stage(which: str, part: str) -> Any:
    """The `scans`, `scenes` or `motion` of a set."""
    if which == "own":
        return _read(DATA / "stage_own_worlds.json.gz")[part]
    return _read(SHARED / "golden" / f"stage_{part}.json.gz")


def tf2(which: str) -> Any:
    """The cases of a set."""
    return _read(DATA / "tf2_small.json.gz" if which == "own" else SHARED / "golden" / "tf2.json.gz")["cases"]


def bitmaps(which: str, world: Any) -> Path:
    """The folder of a recorded world's bitmaps."""
    return (ROOT if which == "own" else SHARED) / (world.get("bitmap_dir") or "worlds")

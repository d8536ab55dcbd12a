"""The tours that robots drive in the study `robots`: waypoints that were planned once."""

import math
from itertools import accumulate, pairwise
from pathlib import Path

import msgspec

from zteam.errors import UsageError
from zteam.kernels.polylines import Polyline

LEAD_IN = 13.0
"""Metres of a tour behind the leader's start, where its followers stand: room for 16 robots."""
_FOLDER = Path(__file__).resolve().parent

Points = list[tuple[float, float]]


class Tour(msgspec.Struct, frozen=True):
    """A way through a world."""

    waypoints: tuple[tuple[float, float], ...]
    """x and y in `map`, metres; the way between two of them is straight."""

    @property
    def length(self) -> float:
        """Metres."""
        return sum(math.dist(a, b) for a, b in pairwise(self.waypoints))

    def split(self, s: float) -> tuple[Points, Points]:
        """The way up to the place `s`, metres from its beginning, and the way from there on."""
        places = accumulate((math.dist(a, b) for a, b in pairwise(self.waypoints)), initial=0.0)
        before = sum(place < s for place in places)
        x, y, _yaw = Polyline(self.waypoints).at(s)
        return [*self.waypoints[:before], (x, y)], [(x, y), *self.waypoints[before:]]


def tours_of(world: str) -> tuple[str, list[Tour]]:
    """The tours whose name begins the name of a world: `willow` for `willow-erratic`. Raises UsageError without any."""
    known = sorted(path.stem for path in _FOLDER.glob("*.json"))
    for name in known:
        if world.startswith(name):
            return name, msgspec.json.decode((_FOLDER / f"{name}.json").read_bytes(), type=list[Tour])
    raise UsageError(f"there are no tours for the world {world!r}: name a world file {' or '.join(known)}")

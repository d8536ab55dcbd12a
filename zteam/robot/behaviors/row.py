"""The row in which robots stand where walls are between them: by the ways that they have driven."""

import math
from collections.abc import Collection, Mapping, Sequence

from zteam.config.robot_ids import chain_from
from zteam.geometry import Point2, Pose2
from zteam.kernels import formations as kernels
from zteam.messages import LaserScan
from zteam.robot.view import View, beams_of

BESIDE_MARGIN = 0.1
"""Metres that have to be free beside the outermost robot."""
BEHIND, AHEAD = 0.5, 1.5
"""Metres along the trail, from the leader and from the own slot, within which walls count."""
BODY = 0.45
"""Metres around another robot within which a hit is that robot."""


def share_for_room(
    scan: LaserScan,
    places: Sequence[Pose2],
    others: Sequence[tuple[float, float]],
    left: float,
    right: float,
    half_width: float,
    ahead: float = AHEAD,
) -> float:
    """The share that walls beside these places of the trail need, without hits on the others. Own base frame."""
    beside = half_width + BESIDE_MARGIN
    # What is further to the side needs nothing.
    side = max(left, right) + beside
    bound = math.hypot(side, ahead) + max(math.hypot(place.x, place.y) for place in places)
    beams = beams_of(scan)
    if beams is None or beams.nearest >= bound:
        return 0.0
    rows = [(x, y, math.cos(yaw), math.sin(yaw)) for x, y, yaw in places]
    offs = kernels.find_sides(beams.axes, beams.distances, others, BODY, bound, rows, (BEHIND, ahead, side))
    needed = [1.0 - (off - beside) / reach for reach, off in zip((left, right), offs, strict=True) if reach > 0.0]
    return min(max([0.0, *needed]), 1.0)


NARROW, ACROSS, OPPOSITE, FACING = 1.5, math.radians(110.0), math.radians(120.0), math.radians(150.0)
"""Metres from wall to wall of a corridor; radians from the nearest hit to those on the other wall, to the nearest of
them, and to that where the laser looks no further: the other wall of a room's corner is nearest 90° from it."""
ABOUT, MOST = 7, 0.7
"""Cells about a place, and the share of those that were looked at that may be open where it is narrow: about a corner
of a room more of them are."""
PASSED = 0.5
"""Metres along their file that a robot has to be behind the one behind it, which has come past."""
CELL = 0.2
"""Metres: side of a cell. The ways on both sides of a wall are not in cells beside each other: bases are wider."""
JUMP = 1.0
"""Metres between two looks after which a robot was set down elsewhere."""
MOST_CELLS = 2000
"""The newest ones are kept."""

Cell = tuple[int, int]


def is_narrow(view: View) -> bool:
    """Whether walls are on both sides of the robot."""
    beams = None if view.scan is None else beams_of(view.scan)
    if beams is None or beams.nearest >= NARROW:
        return False
    mates = [mate.pose[:2] for mate in view.teammates]
    limits = NARROW, ACROSS, OPPOSITE, FACING
    return kernels.is_between(beams.axes, beams.distances, mates, BODY, beams.angles, limits)


class Row:
    """The ways of robots, and the order in which they stand on them."""

    def __init__(self) -> None:
        self._turns = 0
        """How often the line had turned at the last look."""
        self._cells: dict[Cell, bool | None] = {}
        """Whether walls are on both sides there, None where only others were; the oldest first."""
        self._last: dict[int, Point2] = {}

    def note(self, places: Mapping[int, Point2]) -> None:
        """The robots are at these places (m, map) now.

        One that was set down there has the nearest of the others beside it, as in a team that is set down in a row.
        """
        came = {
            robot: at for robot, at in self._last.items() if robot in places and math.dist(at, places[robot]) < JUMP
        }
        for robot, before in came.items():
            self._join(before, places[robot])
        joined, rest = [places[robot] for robot in came], [at for robot, at in places.items() if robot not in came]
        while rest:
            at, other = min(((a, b) for a in rest for b in joined or rest[:1]), key=lambda pair: math.dist(*pair))
            self._join(other, at)
            rest.remove(at)
            joined.append(at)
        self._last = dict(places)

    def look(self, view: View, here: Pose2) -> None:
        """Note where the robots are, and whether walls are on both sides of this one, which is `here` (map)."""
        self.note({mate.robot_id: here.compose(mate.pose)[:2] for mate in view.teammates} | {view.robot_id: here[:2]})
        self.note_walls(here[:2], is_narrow(view))

    def note_walls(self, place: Point2, are_there: bool = True) -> None:
        """Whether walls are on both sides of this place."""
        cell = _cell_at(place)
        self._cells[cell] = are_there or bool(self._cells.get(cell))

    def is_between_walls(self, place: Point2) -> bool:
        """Whether walls are on both sides there, or beside it, as was noted, and not only as in a corner of a room."""
        if not any(map(self._cells.get, _beside(_cell_at(place)))):
            return False
        about = [self._cells.get(cell) for cell in _beside(_cell_at(place), ABOUT)]
        return about.count(False) < MOST * (len(about) - about.count(None))

    def find_ahead(
        self, view: View, head: int, members: Collection[int], ahead: int, turns: int, *, is_new: bool = False
    ) -> int:
        """The robot to follow in the row of these members down from the `head`: mostly the one `ahead` as until now.

        Another one if this robot `is_new` in the row, if the statuses of the members make no row, or if one of them is
        past the robot that it follows and the line has turned. Until then it may be in a ring.
        """
        statuses = view.inputs.get("statuses") or {}
        told = {robot: status.leader for robot, status in statuses.items() if status.gap} | {view.robot_id: ahead}
        chain = chain_from(view.robot_id, told)
        is_tree = any(told.get(robot) == ahead for robot in members if robot != view.robot_id)
        is_broken = is_new or is_tree or chain[-1] in chain[:-1] or ahead not in (*members, head)
        has_turned, self._turns = turns != self._turns, turns
        if head not in self._last or not (is_broken or has_turned):
            return ahead
        from_end = {robot: metres for robot, metres in self.find(head).items() if robot in members}
        first = next((robot for robot in from_end if told.get(robot) == head), head)
        last = next((robot for robot in from_end if robot not in told.values()), head)
        if not is_broken and from_end.get(first, 0.0) < from_end.get(last, 0.0):
            # The head is among them, and the one that was the last is at the other end.
            from_end = {robot: -from_end[robot] for robot in reversed(from_end)}
        is_mixed = any(from_end.get(told.get(robot, -1), math.inf) < far - PASSED for robot, far in from_end.items())
        order = [head, *from_end]
        return order[order.index(view.robot_id) - 1] if is_broken or is_mixed else ahead

    def find(self, first: int) -> dict[int, float]:
        """The other robots, and how many metres each one is from the end of their row over the ways.

        At the end, and the last one, is the robot that is furthest from `first`, which may be anywhere.
        """
        *_, end = self._distances(first)
        from_end = self._distances(end)
        return {robot: from_end[robot] for robot in reversed(from_end) if robot != first}

    def _distances(self, origin: int) -> dict[int, float]:
        """Metres from this robot to each one over the ways, itself first; infinite where none leads there."""
        here, metres = self._last[origin], 0.0
        front = [_cell_at(here)]
        found = dict.fromkeys(front, metres)
        while front:
            metres += CELL
            around = dict.fromkeys(cell for at in front for cell in _beside(at))
            front = [cell for cell in around if cell in self._cells and cell not in found]
            found.update(dict.fromkeys(front, metres))
        far = {robot: found.get(_cell_at(at), math.inf) for robot, at in self._last.items()}
        return dict(sorted(far.items(), key=lambda each: (each[1], math.dist(self._last[each[0]], here), each[0])))

    def _join(self, a: Point2, b: Point2) -> None:
        """A straight way from one place to another."""
        parts = max(1, math.ceil(2.0 * math.dist(a, b) / CELL))
        for part in range(parts + 1):
            share = part / parts
            cell = _cell_at((a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])))
            self._cells[cell] = self._cells.pop(cell, None)
        while len(self._cells) > MOST_CELLS:
            del self._cells[next(iter(self._cells))]


def _cell_at(place: Point2) -> Cell:
    return math.floor(place[0] / CELL), math.floor(place[1] / CELL)


def _beside(cell: Cell, reach: int = 1) -> list[Cell]:
    """The cell and those around it, as many cells far."""
    around = range(-reach, reach + 1)
    return [(cell[0] + dx, cell[1] + dy) for dx in around for dy in around]

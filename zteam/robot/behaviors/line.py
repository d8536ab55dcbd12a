"""A line of robots, which can be led from either end: which robot each one follows now, and which one leads.

Each robot is started to follow the one before it. The robot in front that gets on no more hands over to the one at the
other end: it says `turns` + 1 in its status, and the others count on with it. While the number is even, each follows
the robot that it was started to follow; while it is odd, the one behind. So no robot has to turn round in its place, or
to be passed. A number counts from the robot whose turn it is, and as one turn more: whatever other robots say, they do
not turn the line.
"""

import math
from collections.abc import Mapping, Sequence, Set
from typing import Any, Literal, NamedTuple

from zteam import names
from zteam.clock import to_ns
from zteam.config.robot_ids import chain_from
from zteam.geometry import Pose2
from zteam.messages import RobotStatus
from zteam.reasons import Reason
from zteam.robot.view import View

STATUSES = {"statuses": (names.all_robots_key(names.STATUS), RobotStatus)}
"""What a behaviour declares as `inputs` that asks for the chain."""


Seen = tuple[Pose2, int]
"""Where a robot is in map, and the stamp of that: nanoseconds, 0 where nothing on the way ever moves."""


def see_robot(view: View, robot_id: int, stale_after: float = math.inf) -> tuple[Seen | None, str]:
    """The leader `robot_id`; or None and why not: its pose is not known, or older than `stale_after` s."""
    if robot_id == view.robot_id:
        return None, "it cannot follow itself"
    found = view.map_from_robot(robot_id)
    if found is None:
        return None, f"leader {names.robot_name(robot_id)} not seen"
    pose, stamp = found
    # A stamp of 0 says that nothing on the way ever moves, so there is no age.
    if stamp and abs(view.now - stamp) > stale_after * 1e9:
        return None, f"leader {names.robot_name(robot_id)} not seen for {stale_after:g} s"
    if not math.isfinite(sum(pose)):
        return None, f"the pose of leader {names.robot_name(robot_id)} is no number"
    return found, ""


OnLeaderLost = Literal["relink", "stop", "takeover"]
GAP, MOST_GAP = 0.8, 100.0
"""Metres between neighbours that have told nothing else, and that a robot may tell."""
STRETCHED, TORN = 0.8, 1.5
"""Metres beyond its gap that the robot behind may be away: from the first on a robot slows, at the second it stands."""
CUT_OFF_FOR = to_ns(40.0)
"""Nanoseconds for which a line waits for a robot that fell silent and is not there any more, before it goes past it."""
LEAST_SHARE = 0.05
"""A smaller share of its speed is 0."""
NO_TURNS = -1
"""`turns` of a robot that cannot follow the robot behind it."""
_ROUND = 2**31
"""The number of turns begins again at 0 after so many."""


class LineRole(NamedTuple):
    """What a robot of a line does now: it follows, it leads, or it stands for a reason."""

    before: tuple[int, ...] = ()
    """The living robots before it, from the one to follow to the one that leads; none where it leads, or stands."""
    after: tuple[int, ...] = ()
    """The living robots behind it, if they are a line."""
    behind: int | None = None
    """The first of them, if it can follow."""
    head: int | None = None
    """The robot that was started to lead the line."""
    may_turn: bool = False
    """Whether the robot that leads may hand over to the one at the other end."""
    may_reverse: bool = False
    """Whether the robots behind a head that keeps its place may follow it in the opposite order."""
    reason: str = ""
    """Why it has to stand; empty if it has not."""
    gap: float = GAP
    """Metres that the line keeps between neighbours."""
    gone: Set[int] = frozenset()
    """The robots that are gone: they may stand in the way."""
    turns: int = 0
    """How often the line has been led from the other end since it was there."""
    stopped: Set[int] = frozenset()
    """The robots that say that this one is in their way."""
    watched: Set[int] = frozenset()
    """The head, and the neighbours in the line: it waits while the pose of one is old."""

    @property
    def ahead(self) -> int | None:
        """The robot to follow."""
        return self.before[0] if self.before else None


class Line:
    """One robot's knowledge of its line."""

    def __init__(self) -> None:
        self.turns = 0
        """How often the line has been led from the other end since it was there."""
        self._has_heard = False
        """Whether another robot has told how often the line has turned."""
        self._seen: set[int] = set()
        """The robots that have been alive."""
        self._gone: Set[int] = frozenset()
        self._cut_off: dict[int, int] = {}
        """Since when robots are not alive any more (ns) that were silent before: they may be frozen."""
        self._role = LineRole()
        """The last one found, by what follows."""
        self._statuses: object = self
        self._told: list[tuple[float, ...]] = []
        """What the statuses say of the line."""
        self._found_by: tuple[object, ...] = ()

    def find_gone(self, view: View) -> Set[int]:
        """The robots that were alive since this one began, and are not any more.

        A robot that never was alive may be driven by something else: its transforms are followed. None is gone while
        this robot does not even know that itself is there.
        """
        if view.robot_id not in view.team:
            return frozenset()
        self._seen.update(view.team)
        before, self._gone = self._gone, self._seen.difference(view.team)
        # An ended process is gone at once, a frozen one is silent before.
        fresh = dict.fromkeys((self._gone - before) & view.silent, view.now)
        self._cut_off = {robot: since for robot, since in {**self._cut_off, **fresh}.items() if robot in self._gone}
        return self._gone

    def find_role(
        self, view: View, leader: int | None, on_lost: OnLeaderLost = "relink", *, may_turn: bool = True
    ) -> LineRole:
        """The role of a robot that was started to follow `leader`, or to lead. Robots that are gone are left out."""
        statuses: Mapping[int, Any] | None = view.inputs.get("statuses")
        # Statuses come at 1 Hz, the next ones in another mapping, and mostly say the same.
        if statuses is not self._statuses:
            self._statuses, told = statuses, (statuses or {}).items()
            self._told = [(robot, s.leader, s.gap, s.turns, s.waits_for, s.blocked_by) for robot, s in told]
        found_by = leader, on_lost, may_turn, self.turns, view.team, view.silent, self._told
        if found_by != self._found_by or self._cut_off:
            self._found_by = found_by
            self._role = self._new_role(view, leader, on_lost, statuses or {}, may_turn)
        return self._role

    def _new_role(
        self, view: View, leader: int | None, on_lost: OnLeaderLost, statuses: Mapping[int, Any], may_turn: bool
    ) -> LineRole:
        gone = self.find_gone(view)
        if on_lost == "relink":
            # Those that were cut off may come back soon.
            gone = gone - {robot for robot, since in self._cut_off.items() if view.now - since < CUT_OFF_FOR}
        # A robot that follows in another way, as in a formation, publishes no gap, and is a head.
        leaders = {robot: told.leader for robot, told in statuses.items() if told.leader >= 0 and told.gap > 0.0}
        leaders.pop(view.robot_id, None)
        if leader is not None:
            leaders[view.robot_id] = leader
        line = chain_from(view.robot_id, leaders)[::-1]
        if line[0] in line[1:]:
            return LineRole(reason="the robots follow each other in a circle")
        lost = [robot for robot in reversed(line[:-1]) if robot in gone]
        order, is_tree = _order(line, leaders)
        head = order[0]
        if lost and (on_lost == "stop" or (on_lost == "relink" and head in gone)):
            missed = lost[0] if on_lost == "stop" else head
            return LineRole(reason=Reason(f"leader {names.robot_name(missed)} is gone", waits_for=missed))
        told = {robot: statuses[robot] for robot in order if robot in statuses}
        turns = {robot: status.turns for robot, status in told.items()}
        turns[view.robot_id] = 0 if may_turn else NO_TURNS
        living = [robot for robot in order if robot not in gone]
        stays = turns.get(living[0], NO_TURNS) == NO_TURNS
        others = [turns.get(robot, 0) for robot in living[stays:]]
        can_turn = not is_tree and len(others) > 1 and NO_TURNS not in others
        # Behind a head that keeps its place the last robot turns the line, which is not the one that leads.
        self._count_turns(view.robot_id, turns, [] if is_tree else living[:0:-1] if stays else living)
        if self.turns % 2 and not is_tree:
            living[stays:] = living[stays:][::-1]
        at = living.index(view.robot_id)
        after = () if is_tree else tuple(living[at + 1 :])
        before = tuple(reversed(living[:at]))
        # A robot that stands until a lost one comes back, or that waits itself, is not waited for.
        status = statuses.get(after[0]) if after else None
        waits = bool(after) and (status is None or status.waits_for < 0)
        return LineRole(
            before=before,
            after=after,
            behind=after[0] if waits else None,
            head=head,
            may_turn=can_turn and not stays,
            may_reverse=can_turn and stays,
            gap=max([GAP, *[min(status.gap, MOST_GAP) for status in told.values() if status.gap > 0.0]]),
            gone=gone,
            turns=self.turns,
            stopped={robot for robot, status in statuses.items() if status.blocked_by == view.robot_id},
            watched={*before[:1], *before[-1:], *after[:1]},
        )

    def _count_turns(self, own: int, turns: Mapping[int, int], line: Sequence[int]) -> None:
        """Count on with what the robots of the line tell. Of `line` the first hands over while the number is even, the
        last while it is odd; it is empty where the line cannot turn.

        A robot that begins, or that has missed some turns, takes the number that most of the others tell.
        """
        told = {robot: turns[robot] for robot in line if robot != own and turns.get(robot, NO_TURNS) != NO_TURNS}
        if told:
            numbers = [*told.values()]
            agreed = min({*numbers}, key=lambda number: (-numbers.count(number), number))
            most = numbers.count(agreed)
            if not self._has_heard or (most > 1 and 2 * most > len(told) and self._ahead(agreed)):
                self.turns = agreed
            self._has_heard = True
        if len(line) > 1:
            # The next number at which it is an end's turn that has not told more.
            ends = (line[0], 0), (line[-1], 1)
            self.turn_on(min(self._until(told.get(robot, self.turns), rest) for robot, rest in ends))

    def _ahead(self, number: int) -> int:
        """How many turns a number is ahead; 0 if it is behind, also round the end of the numbers."""
        ahead = (number - self.turns) % _ROUND
        return ahead if ahead < _ROUND // 2 else 0

    def _until(self, number: int, rest: int) -> int:
        """The turns from now to `number` or after it that leave this rest, by 2."""
        ahead = self._ahead(number)
        return ahead + ((self.turns + ahead) % 2 != rest)

    def turn_on(self, turns: int = 1) -> None:
        """The line is led from its other end, so many times more."""
        self.turns = (self.turns + turns) % _ROUND


def _order(line: list[int], leaders: Mapping[int, int]) -> tuple[list[int], bool]:
    """The robots from the head to the last one behind the end of `line`, or a branch; and whether it has any."""
    behind = {leader: robot for robot, leader in leaders.items()}
    branches = {leader for robot, leader in leaders.items() if behind[leader] != robot}
    while line[-1] in behind and line[-1] not in branches:
        line.append(behind[line[-1]])
    return line, not branches.isdisjoint(line)


def waits_for(robot: int, why: str) -> Reason:
    """What a robot says that stands because one before it does, or comes past: then nothing waits for itself."""
    return Reason(f"waits: {names.robot_name(robot)} {why}", waits_for=robot)


def keep_together(view: View, own: Pose2, role: LineRole) -> tuple[float, str]:
    """The share of its speed, 1 to 0, at which a robot at `own` (map) keeps the one behind it; and why that is 0."""
    seen = None if role.behind is None else view.map_from_robot(role.behind)
    if role.behind is None or seen is None:
        return 1.0, ""
    share = (role.gap + TORN - math.hypot(seen[0].x - own.x, seen[0].y - own.y)) / (TORN - STRETCHED)
    if share > LEAST_SHARE:
        return min(1.0, share), ""
    # Without the distance: each other text is a line of the log and a status.
    return 0.0, f"waits for {names.robot_name(role.behind)} behind it"

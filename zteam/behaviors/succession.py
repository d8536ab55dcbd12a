"""Which robot a robot of a chain follows when others are gone, and which one leads then.

Every robot decides for itself, from what all of them know: which robot each one is to follow, and which ones are gone.
So they agree, and the chain is as before when a robot comes back.
"""

from collections.abc import Collection, Mapping, Set
from typing import Literal, NamedTuple

from zteam import names
from zteam.behaviors.view import View

OnLeaderLost = Literal["relink", "stop", "takeover"]


class Role(NamedTuple):
    """What a robot of a chain does now: it follows, it leads (no robot is before it), or it stands for a reason."""

    before: tuple[int, ...] = ()
    """The living robots before it, from the one to follow to the head."""
    reason: str = ""
    """Why it has to stand; empty if it has not."""


def find_role(
    own: int, leaders: Mapping[int, int], gone: Set[int], on_lost: OnLeaderLost, heirs: Collection[int] = ()
) -> Role:
    """The role of the robot `own`; `leaders` says which robot each one is to follow, also those that are `gone`.

    `heirs` are those that may take over besides the first living robot of the own chain: where the chain is a tree,
    other robots follow its head too. The one that has the fewest robots before it takes over, of several the one with
    the lowest id.
    """
    before = chain_before(own, leaders)
    if before is None:
        return Role(reason="the robots follow each other in a circle")
    lost = next((robot for robot in before if robot in gone), None)
    head = before[-1]
    if lost is not None and (on_lost == "stop" or (on_lost == "relink" and head in gone)):
        return Role(reason=f"leader {names.robot_name(lost if on_lost == 'stop' else head)} is gone")
    alive = [robot for robot in before if robot not in gone]
    if head in gone:
        first = alive[-1] if alive else own
        heir = _heir(head, {first, *heirs} - gone, leaders, gone)
        if heir == own:
            return Role()
        if heir not in alive:
            alive.append(heir)
    return Role(tuple(alive))


def chain_before(own: int, leaders: Mapping[int, int]) -> list[int] | None:
    """The robots before `own`, from the one that it is to follow to the head; None if they lead back to one of them.

    Raises KeyError if `own` is to follow no robot.
    """
    found = [leaders[own]]
    while (leader := leaders.get(found[-1])) is not None:
        if leader in found or leader == own:
            return None
        found.append(leader)
    return None if own in found else found


def _heir(head: int, heirs: Set[int], leaders: Mapping[int, int], gone: Set[int]) -> int:
    """Which of the `heirs` leads the chain whose head is gone: at least one has no living robot before it."""
    places = []
    for robot in heirs:
        before = chain_before(robot, leaders) if robot in leaders else None
        if before is not None and before[-1] == head and gone >= set(before):
            places.append((len(before), robot))
    return min(places)[1]


class Presence:
    """Which robots have gone: those that were alive since this robot began, and are not any more.

    A robot that never was alive may be driven by something else, so it is not gone: its transforms are followed.
    """

    def __init__(self) -> None:
        self._seen: set[int] = set()
        self._team: tuple[int, ...] = ()
        """What `_gone` was found for."""
        self._gone: Set[int] = frozenset()

    def find_gone(self, view: View) -> Set[int]:
        """Those that are gone now; none while the robot does not even know that itself is there."""
        # Mostly it is the same object, and then as many are gone as before.
        if view.team is not self._team:
            self._team = view.team
            if view.robot_id in view.team:
                self._seen.update(view.team)
                self._gone = self._seen.difference(view.team)
            else:
                self._gone = frozenset()
        return self._gone

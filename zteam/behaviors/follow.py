"""Follow another robot: along the trail of the robot that leads the chain, or straight by the transforms alone."""

import logging
import math
from collections.abc import Mapping, Set
from typing import Any, ClassVar

import msgspec

from zteam import names
from zteam.behaviors.behavior import Behavior
from zteam.behaviors.chain import STATUSES, behavior_of, find_leaders, see_robot
from zteam.behaviors.direct_law import DirectLaw
from zteam.behaviors.follow_params import FollowParams, Law
from zteam.behaviors.polyline import Polyline
from zteam.behaviors.succession import Presence, Role, chain_before, find_role
from zteam.behaviors.takeover import Takeover
from zteam.behaviors.trail_law import TrailLaw
from zteam.behaviors.view import View
from zteam.messages import Message, Twist

log = logging.getLogger("zteam")

_LAWS: dict[Law, type[TrailLaw | DirectLaw]] = {"trail": TrailLaw, "direct": DirectLaw}


class _Chain(msgspec.Struct, frozen=True):
    """What a robot makes of the chain. It holds as long as these objects do: they are replaced, not changed."""

    statuses: Any
    gone: Set[int]
    params: FollowParams
    leaders: Mapping[int, int]
    role: Role


class Follow(Behavior):
    """Follow a robot: along the trail of the robot at the head of the chain (law trail), or straight (law direct).

    With law trail each robot of a chain keeps its own distance behind the head, so no error grows along the chain.
    With law direct it turns to its leader and drives up to it, round what stands between.
    """

    Params = FollowParams
    params: FollowParams
    uses_tf = True
    inputs: ClassVar[Mapping[str, tuple[str, type[Message]]]] = STATUSES

    def __init__(self, params: FollowParams) -> None:
        super().__init__(params)
        self.leader: int = params.leader
        self._law = _LAWS[params.law]()
        self._presence = Presence()
        self._takeover: Takeover | None = None
        """While it leads."""
        self._known: _Chain | None = None
        self._head = params.leader
        """The robot that led the chain last."""
        self._told: tuple[int, ...] = (params.leader,)
        """The robot that it follows, as its log has it; none while it leads."""

    def on_params(self) -> None:
        """Follow the robot that `params` names, by the law that they name."""
        if self.params.leader != self.leader:
            self.leader = self.params.leader
            self._told = (self.leader,)
        self._takeover = None
        if not isinstance(self._law, _LAWS[self.params.law]):
            self._law = _LAWS[self.params.law]()

    def step(self, view: View) -> Twist:
        """By its law; zero where a pose that it needs is not known for certain, or a robot in front is gone."""
        gone = self._presence.find_gone(view)
        leaders, role = self._find_chain(view, gone)
        if role.reason:
            self._takeover, self.reason = None, role.reason
            return Twist()
        self._tell(role.before[:1])
        if role.before:
            self._takeover, self._head = None, role.before[-1]
            command, self.reason = self._law.step(view, role.before, gone, self.params)
        else:
            self._takeover = self._takeover or self._take_over(view, leaders)
            command, self.reason = self._takeover.step(view, gone, self.params.max_linear, self.params.max_angular)
        return command

    def _find_chain(self, view: View, gone: Set[int]) -> tuple[Mapping[int, int], Role]:
        """The robot that each robot follows, and the own role."""
        statuses, known = view.inputs.get("statuses"), self._known
        if known is not None and (known.gone is not gone or known.params is not self.params):
            known = None
        if known is None or known.statuses is not statuses:
            leaders = find_leaders(view, self.leader)
            # In most ticks some robot tells a new status, but seldom another leader.
            if known is not None and known.leaders == leaders:
                role = known.role
            else:
                role = find_role(view.robot_id, leaders, gone, self.params.on_leader_lost, leaders.keys())
            known = self._known = _Chain(statuses, gone, self.params, leaders, role)
        return known.leaders, known.role

    def _tell(self, ahead: tuple[int, ...]) -> None:
        if ahead != self._told:
            self._told = ahead
            log.info("%s now", f"follows {names.robot_name(ahead[0])}" if ahead else "leads the chain")

    def _take_over(self, view: View, leaders: Mapping[int, int]) -> Takeover:
        """Lead the chain, whose head is gone, in the place of the robot that led it last."""
        named = chain_before(view.robot_id, leaders) or [self.leader]
        then = self.params.takeover_behavior
        seen, _ = see_robot(view, self._head, names.MAP_FRAME, math.inf)
        trail = self._law.trail if isinstance(self._law, TrailLaw) else Polyline()
        return Takeover(
            trail, None if seen is None else seen.pose, behavior_of(view, named[-1]) if then == "same" else then
        )

    def missing(self, view: View) -> list[str]:
        """The leader's pose, as long as it is not there or old."""
        seen, _ = see_robot(view, self.leader, view.base_frame, self.params.stale_after)
        return [] if seen else [f"the pose of its leader {names.robot_name(self.leader)}"]

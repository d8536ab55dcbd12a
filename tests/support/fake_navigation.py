"""A navigation by hand: it takes goals on a bus in memory and says of them what the test tells it to."""

from typing import Any

import msgspec

from zteam import names
from zteam.bus import Bus, MemoryHub, NoRequest
from zteam.messages import Duration, Header, NavigationState, NavigationStatus, PoseStamped
from zteam.robot.client import CANCEL, CancelReply, CancelRequest, navigation_query


class _Info(msgspec.Struct):
    instance: str


class FakeNavigation:
    """Of one robot. It takes each goal at once, and says that it drives; what follows is said with `say`."""

    def __init__(self, hub: MemoryHub, robot_id: int, *, hears: bool = True, go_to: bool = False) -> None:
        """With `hears` False it says that it is there, and takes no goals; with `go_to` it is a robot's behaviour."""
        self.bus: Bus = hub.bus()
        self.robot_id = robot_id
        self.goals: list[PoseStamped] = []
        self.cancels = 0
        self.is_deaf = False
        """Whether goals do not reach it."""
        self.obeys = True
        """Whether it says `canceled` when it is asked to cancel."""
        key = names.robot_key(robot_id, names.NAVIGATION_STATUS)
        self._publisher = self.bus.publisher(key, NavigationStatus)
        if hears:
            self.bus.subscribe(names.robot_key(robot_id, names.GOAL_POSE), PoseStamped, self._on_goal)
        self.bus.serve(navigation_query(robot_id, CANCEL), CancelRequest, self._cancel)
        self.bus.serve(navigation_query(robot_id, "info"), NoRequest, lambda _: _Info(self.bus.instance))
        process = names.robot_name(robot_id) if go_to else names.navigation_name(robot_id)
        self._header = Header(frame_id=process if go_to else names.MAP_FRAME)
        self._token = self.bus.declare_token(names.token_key(process, self.bus.instance))

    def say(self, state: int, *, left: float = 0.0, seconds: int = 0, **fields: Any) -> None:
        """Publish a status about the newest goal; `left` metres and `seconds` are left."""
        goal = self.goals[-1] if self.goals else PoseStamped()
        told = {"distance_remaining": left, "estimated_time_remaining": Duration(seconds), "goal": goal, **fields}
        self._publisher.put(NavigationStatus(self._header, state, **told))

    def _on_goal(self, _key: str, goal: PoseStamped) -> None:
        if self.is_deaf:
            return
        self.goals.append(goal)
        self.say(NavigationState.DRIVING, left=5.0, seconds=10)

    def _cancel(self, _request: CancelRequest) -> CancelReply:
        if self.obeys and self.goals:
            self.say(NavigationState.CANCELED)
        # Last: a test that waits for the count then finds the status sent.
        self.cancels += 1
        return CancelReply(bool(self.goals))

    def end(self) -> None:
        """The process is gone."""
        self._token.close()
        self.bus.close()

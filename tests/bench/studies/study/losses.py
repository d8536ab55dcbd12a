"""A follower on a bad network."""

from collections.abc import Mapping
from typing import Any

from msgspec.structs import replace

from zteam import names
from zteam.counter_random import uniform
from zteam.geometry import Pose2
from zteam.messages import Twist
from zteam.robot.behaviors.follow import Follow, FollowParams
from zteam.robot.view import View

SHARE = 0.05
"""Of the messages of others that are lost, each by itself."""
_STREAM = 710
"""Apart from the streams of others' random numbers."""


class LossyFollow(Follow):
    """`follow`, to which a share of the teammates' poses and statuses never comes: it goes on with the ones before."""

    Params = FollowParams
    why_it_rests = Follow.why_it_rests

    def __init__(self, params: FollowParams) -> None:
        super().__init__(params)
        self._losses = Losses(SHARE)

    def step(self, view: View) -> Twist:
        """As `follow`."""
        return super().step(self._losses.lose(view))

    def missing(self, view: View) -> list[str]:
        """As `follow`."""
        return super().missing(self._losses.lose(view))


class Losses:
    """What came of others' messages: of each robot in each tick all or nothing."""

    def __init__(self, share: float) -> None:
        self._share = share
        self._poses: dict[str, tuple[Pose2, int]] = {}
        """The newest ones in `map` that came, by frame."""
        self._messages: dict[tuple[str, int], Any] = {}

    def lose(self, view: View) -> View:
        """The same view without what is lost. Call it in every step, because it remembers what came."""
        for frame in self._poses:
            self._map_from(view, frame)

        def lookup(target: str, source: str) -> tuple[Pose2, int] | None:
            a, b = self._map_from(view, target), self._map_from(view, source)
            if a is None or b is None:
                return None
            return a[0].inverse().compose(b[0]), min(filter(None, (a[1], b[1])), default=0)

        heard = {name: self._heard(view, name, given) for name, given in view.inputs.items()}
        return replace(view, lookup=lookup, inputs=heard)

    def _is_lost(self, view: View, robot_id: int) -> bool:
        return (
            robot_id != view.robot_id and uniform(view.seed, _STREAM, view.robot_id, robot_id, view.now) < self._share
        )

    def _map_from(self, view: View, frame: str) -> tuple[Pose2, int] | None:
        robot_id = names.robot_id_of(frame.partition("/")[0])
        found = view.lookup(names.MAP_FRAME, frame)
        if robot_id is None or robot_id == view.robot_id or found is None:
            return found
        if frame not in self._poses or not self._is_lost(view, robot_id):
            self._poses[frame] = found
        return self._poses[frame]

    def _heard(self, view: View, name: str, given: Any) -> Any:
        if not isinstance(given, Mapping):
            return given
        for robot_id, message in given.items():
            if (name, robot_id) not in self._messages or not self._is_lost(view, robot_id):
                self._messages[name, robot_id] = message
        return {robot_id: self._messages[name, robot_id] for robot_id in given}

"""Behaviours of studies: the lectures' follower as it was written, followers on a bad network, a leader in bends."""

import math
from bisect import bisect_right
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from msgspec import Meta, Struct
from msgspec.structs import replace

from zteam import names
from zteam.clock import to_ns
from zteam.counter_random import gaussians, stream, uniform
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.robot.behaviors.behavior import Behavior
from zteam.robot.behaviors.follow import Follow, FollowParams
from zteam.robot.view import View

Found = tuple[Pose2, int] | None
MIN_DIST, MAX_LINEAR, MAX_ANGULAR = 0.8, 0.7, 3.14
_DISTURBED, _LOST = 700, 710
"""Streams of random numbers, apart from those of the simulator's noise."""
_KEPT = 100
"""Poses of a frame that are kept: 10 s of Stage's ticks."""
SHARE = 0.05
"""Of the messages of others that are lost, each by itself."""


class LecturesParams(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of the lectures' follower."""

    leader: Annotated[int, Meta(ge=0, le=names.MAX_ROBOT_ID, description="id of the robot to follow")]


class LecturesFollow(Behavior):
    """Towards the leader by the newest transform, however old it is; turns to the right have no limit."""

    Params = LecturesParams
    params: LecturesParams
    uses_tf = True

    def __init__(self, params: LecturesParams) -> None:
        super().__init__(params)
        self.leader: int = params.leader
        self._seen = Pose2(0.0, 0.0, 0.0)

    def step(self, view: View) -> Twist:
        """v = 0.5 d and w = 4 atan2(y, x), with an upper limit each; zero within 0.8 m."""
        found = view.base_from_robot(self.leader)
        if found is not None:
            self._seen = found[0]
        distance = math.hypot(self._seen.x, self._seen.y)
        if distance <= MIN_DIST:
            return Twist()
        turn = min(4.0 * math.atan2(self._seen.y, self._seen.x), MAX_ANGULAR)
        return Twist(Vector3(min(0.5 * distance, MAX_LINEAR)), Vector3(0.0, 0.0, turn))

    def missing(self, view: View) -> list[str]:
        """The leader's pose, as long as it is not there."""
        return [] if view.base_from_robot(self.leader) else [f"the pose of its leader {names.robot_name(self.leader)}"]


class Network:
    """What a robot gets of the others."""

    def change(self, view: View) -> View:
        """The view with the look-ups of this network. Call it in every step: it remembers what came."""
        self.begin(view)

        def lookup(target: str, source: str) -> Found:
            a, b = self._map_from(view, target), self._map_from(view, source)
            if a is None or b is None:
                return None
            return a[0].inverse().compose(b[0]), min(filter(None, (a[1], b[1])), default=0)

        return replace(view, lookup=lookup)

    def begin(self, view: View) -> None:
        """A new step."""
        raise NotImplementedError

    def pose(self, view: View, frame: str, robot_id: int) -> Found:
        """The frame of a robot in `map`."""
        raise NotImplementedError

    def _map_from(self, view: View, frame: str) -> Found:
        robot_id = names.robot_id_of(frame.partition("/")[0])
        return view.lookup(names.MAP_FRAME, frame) if robot_id is None else self.pose(view, frame, robot_id)


class Disturbance(Network):
    """Teammates' poses come `delay` seconds late, and every robot errs in each tick by `noise` metres in x and y.

    The error of a robot is the same in each look-up, its own ones and those of others.
    """

    def __init__(self, delay: float, noise: float) -> None:
        self._delay = to_ns(delay)
        self._noise = noise
        self._history: dict[str, list[tuple[int, Pose2]]] = {}
        """By frame: exact poses in `map`, by their stamps."""

    def begin(self, view: View) -> None:
        """Keep the poses of now."""
        for frame in self._history:
            self._keep(view, frame)

    def pose(self, view: View, frame: str, robot_id: int) -> Found:
        """The pose of then, with the error of then."""
        if frame not in self._history:
            self._keep(view, frame)
        seen = self._history[frame]
        if not seen:
            return None
        newest = view.now if robot_id == view.robot_id else view.now - self._delay
        stamp, pose = seen[max(0, bisect_right(seen, newest, key=lambda entry: entry[0]) - 1)]
        state = stream(view.seed, _DISTURBED, robot_id, stamp)
        dx, dy = (self._noise * gaussians(np.array([state], np.uint64), 2)[0]).tolist()
        return Pose2(pose.x + dx, pose.y + dy, pose.yaw), stamp

    def _keep(self, view: View, frame: str) -> None:
        seen = self._history.setdefault(frame, [])
        found = view.lookup(names.MAP_FRAME, frame)
        if found is not None and (not seen or found[1] > seen[-1][0]):
            seen.append((found[1], found[0]))
            del seen[:-_KEPT]


class Losses(Network):
    """A share of the others' poses and statuses never comes: of each robot in each tick all or nothing."""

    def __init__(self, share: float) -> None:
        self._share = share
        self._poses: dict[str, tuple[Pose2, int]] = {}
        """By frame: the newest that came."""
        self._messages: dict[tuple[str, int], Any] = {}

    def change(self, view: View) -> View:
        """The view without what is lost."""
        inputs = {name: self._input(view, name, given) for name, given in view.inputs.items()}
        return replace(super().change(view), inputs=inputs)

    def begin(self, view: View) -> None:
        """Take the poses that come now."""
        for frame in self._poses:
            self._map_from(view, frame)

    def pose(self, view: View, frame: str, robot_id: int) -> Found:
        """The newest pose that came."""
        found = view.lookup(names.MAP_FRAME, frame)
        if robot_id == view.robot_id or found is None:
            return found
        if frame not in self._poses or not self._is_lost(view, robot_id):
            self._poses[frame] = found
        return self._poses[frame]

    def _is_lost(self, view: View, robot_id: int) -> bool:
        return robot_id != view.robot_id and uniform(view.seed, _LOST, view.robot_id, robot_id, view.now) < self._share

    def _input(self, view: View, name: str, given: Any) -> Any:
        if not isinstance(given, Mapping):
            return given
        for robot_id, message in given.items():
            if (name, robot_id) not in self._messages or not self._is_lost(view, robot_id):
                self._messages[name, robot_id] = message
        return {robot_id: self._messages[name, robot_id] for robot_id in given}


class LossyFollow(Follow):
    """`follow` on a bad network; the safety layer below it has all that came."""

    Params = FollowParams
    why_it_rests = Follow.why_it_rests

    def __init__(self, params: FollowParams) -> None:
        super().__init__(params)
        self._network = self.network()

    def network(self) -> Network:
        """That it gets others' messages from."""
        return Losses(SHARE)

    def step(self, view: View) -> Twist:
        """As `follow`."""
        return super().step(self._network.change(view))

    def missing(self, view: View) -> list[str]:
        """As `follow`."""
        return super().missing(self._network.change(view))


class DisturbedParams(FollowParams, frozen=True, forbid_unknown_fields=True):
    """Parameters of `follow`, and the disturbance."""

    delay: Annotated[float, Meta(ge=0.0, le=5.0, description="s; teammates' poses are so much older")] = 0.3
    noise: Annotated[float, Meta(ge=0.0, le=1.0, description="m; deviation of every robot's x and y in map")] = 0.02


class DisturbedFollow(LossyFollow):
    """`follow` on a slow network, with robots that do not know exactly where they are."""

    Params = DisturbedParams
    params: DisturbedParams

    def network(self) -> Network:
        """As its parameters say."""
        return Disturbance(self.params.delay, self.params.noise)


class SlalomParams(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of the slalom."""

    speed: float = 0.4
    """m/s."""
    turn: float = 0.2
    """rad/s, at most."""
    frequency: float = 0.5
    """rad/s."""


class Slalom(Behavior):
    """The same speed for ever, with a turn rate that is a sine of time since the first step."""

    Params = SlalomParams
    params: SlalomParams

    def __init__(self, params: SlalomParams) -> None:
        super().__init__(params)
        self._begun = 0

    def step(self, view: View) -> Twist:
        """On round the next bend."""
        self._begun = self._begun or view.now
        seconds = (view.now - self._begun) / 1e9
        turn = self.params.turn * math.sin(self.params.frequency * seconds)
        return Twist(Vector3(self.params.speed), Vector3(z=turn))

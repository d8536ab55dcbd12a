"""Transforms as over a slow network from robots that do not know exactly where they are."""

from bisect import bisect_right
from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta

from zteam import names
from zteam.clock import to_ns
from zteam.counter_random import gaussians, stream
from zteam.geometry import Pose2
from zteam.messages import Twist
from zteam.robot.behaviors.follow import Follow, FollowParams
from zteam.robot.view import View

Found = tuple[Pose2, int] | None
_STREAM = 700
"""Apart from the streams of the simulator's noise."""
_KEPT = 100
"""Poses of a frame that are kept: 10 s of Stage's ticks."""


class DisturbedParams(FollowParams, frozen=True, forbid_unknown_fields=True):
    """Parameters of `follow`, and the disturbance."""

    delay: Annotated[float, Meta(ge=0.0, le=5.0, description="s; teammates' poses are so much older")] = 0.3
    noise: Annotated[float, Meta(ge=0.0, le=1.0, description="m; deviation of every robot's x and y in map")] = 0.02


class DisturbedFollow(Follow):
    """`follow`, with disturbed look-ups; the safety layer below it has the undisturbed ones."""

    Params = DisturbedParams
    params: DisturbedParams

    def __init__(self, params: DisturbedParams) -> None:
        super().__init__(params)
        self._disturbance = Disturbance(params.delay, params.noise)

    def step(self, view: View) -> Twist:
        """As `follow`."""
        return super().step(self._disturbance.disturb(view))

    def missing(self, view: View) -> list[str]:
        """As `follow`."""
        return super().missing(self._disturbance.disturb(view))


class Disturbance:
    """Teammates' poses come `delay` seconds late, and every robot errs in each tick by `noise` metres in x and y.

    The error of a robot is the same in each look-up, its own ones and those of others.
    """

    def __init__(self, delay: float, noise: float) -> None:
        self._delay = to_ns(delay)
        self._noise = noise
        self._history: dict[str, list[tuple[int, Pose2]]] = {}
        """By frame: exact poses in `map`, by their stamps."""

    def disturb(self, view: View) -> View:
        """The same view with disturbed look-ups. Call it in every step, because it remembers what it sees."""
        for frame in self._history:
            self._keep(view, frame)

        def lookup(target: str, source: str) -> Found:
            a, b = self._map_from(view, target), self._map_from(view, source)
            if a is None or b is None:
                return None
            return a[0].inverse().compose(b[0]), min(filter(None, (a[1], b[1])), default=0)

        return msgspec.structs.replace(view, lookup=lookup)

    def _map_from(self, view: View, frame: str) -> Found:
        robot_id = names.robot_id_of(frame.partition("/")[0])
        if robot_id is None:
            return view.lookup(names.MAP_FRAME, frame)
        if frame not in self._history:
            self._keep(view, frame)
        seen = self._history[frame]
        if not seen:
            return None
        newest = view.now if robot_id == view.robot_id else view.now - self._delay
        stamp, pose = seen[max(0, bisect_right(seen, newest, key=lambda entry: entry[0]) - 1)]
        state = stream(view.seed, _STREAM, robot_id, stamp)
        dx, dy = (self._noise * gaussians(np.array([state], np.uint64), 2)[0]).tolist()
        return Pose2(pose.x + dx, pose.y + dy, pose.yaw), stamp

    def _keep(self, view: View, frame: str) -> None:
        seen = self._history.setdefault(frame, [])
        found = view.lookup(names.MAP_FRAME, frame)
        if found is not None and (not seen or found[1] > seen[-1][0]):
            seen.append((found[1], found[0]))
            del seen[:-_KEPT]

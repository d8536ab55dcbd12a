"""Trials in the simulator: a small world, another robot, and the safety layer under both, as in a team."""

import math
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

from zteam import names
from zteam.clock import NS_PER_S, to_ns
from zteam.config.resources import find_world
from zteam.geometry import Pose2
from zteam.messages import Twist
from zteam.messages.base import DEFAULT_BASE
from zteam.robot.behaviors.behavior import View
from zteam.robot.behaviors.straight import Forward, ForwardParams
from zteam.robot.safety import SafetyLayer, decide
from zteam.robot.trials.situations import LEADER, ROBOT, lookup_in
from zteam.robot.trials.subject import StepAnswer, Subject
from zteam.simulator.core import Engine, Observation
from zteam.simulator.core.to_messages import odometry_message, scan_message
from zteam.simulator.world import World, add_robot, load_world

SECONDS = 10.0
"""Simulated seconds of a trial."""
_WORLD = "arena"


class Start(NamedTuple):
    """Where both robots of a trial begin, in `map`, and the speed of the other one (m/s)."""

    own: Pose2
    other: Pose2
    speed: float = 0.0


PLACES = {
    "a robot stands in its way": Start(Pose2(-1.0, 0.0, 0.0), Pose2(0.8, 0.0, math.pi)),
    "a robot drives towards it": Start(Pose2(-2.0, 0.0, 0.0), Pose2(2.5, 0.1, math.pi), 0.4),
    "a wall is right behind it": Start(Pose2(-4.4, 0.0, 0.0), Pose2(-2.0, 1.0, -0.5 * math.pi), 0.3),
    "it starts in a corner": Start(Pose2(4.2, 4.2, 0.25 * math.pi), Pose2(2.7, 4.0, 0.0), 0.2),
}
"""By the name of the trial."""


class TrialDrive:
    """A robot's drive from a place on, and what came of it."""

    def __init__(self, subject: Subject, place: Start, inputs: Mapping[str, Any]) -> None:
        """`inputs` are what the robot's views hold of its declared inputs."""
        self._subject, self._inputs = subject, inputs
        self._world = _load()
        starts = {LEADER: place.other, ROBOT: place.own}
        robots = {i: add_robot(self._world, "erratic", pose, names.robot_name(i)) for i, pose in starts.items()}
        self._engine = Engine(self._world, robots=robots)
        self._layers = {i: SafetyLayer() for i in robots}
        self._other = Forward(ForwardParams(place.speed))
        self._at = place.own
        self.answers: list[StepAnswer] = []
        self.travelled = 0.0
        """Metres."""
        self.cut = 0.0
        """Seconds in which the safety layer slowed the robot down or stopped it."""
        self.contact = 0.0
        """Seconds in which it drove against something."""
        self.contact_at: Pose2 | None = None
        """Where that began."""

    def run(self) -> None:
        """Drive for SECONDS. Raises TrialOver."""
        commands: dict[int, Twist] = {}
        for _ in range(round(to_ns(SECONDS) / self._world.interval)):
            observation = self._engine.step(commands)
            self._note(observation)
            view = self._view(observation, ROBOT)
            answer = self._subject.step(view)
            self.answers.append(answer)
            command, cause = self._layers[ROBOT].limit(answer.wanted, view, answer.reason)
            self.cut += self._tick if cause else 0.0
            other, _ = decide(self._other, self._view(observation, LEADER), self._layers[LEADER])
            commands = {ROBOT: command, LEADER: other}

    @property
    def _tick(self) -> float:
        return self._world.interval / NS_PER_S

    def _note(self, observation: Observation) -> None:
        robot = observation.robots[ROBOT]
        self.travelled += math.dist(robot.truth[:2], self._at[:2])
        self._at = robot.truth
        if robot.stall:
            self.contact += self._tick
            self.contact_at = self.contact_at or self._at

    def _view(self, observation: Observation, robot_id: int) -> View:
        now = observation.stamp
        return View(
            now=now,
            dt=self._tick if observation.tick > 1 else 0.0,
            robot_id=robot_id,
            scan=scan_message(observation, robot_id, 0),
            odom=odometry_message(observation, robot_id),
            lookup=lookup_in({i: robot.truth for i, robot in observation.robots.items()}, now),
            team=tuple(observation.robots),
            bases=dict.fromkeys(observation.robots, DEFAULT_BASE),
            inputs=self._inputs if robot_id == ROBOT else {},
        )


@cache
def _load() -> World:
    return load_world(find_world(_WORLD))

"""Trials in the simulator: a small world, another robot, and the safety layer under both, as in a team."""

import math
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, NamedTuple

from zteam import names
from zteam.clock import NS_PER_S, to_ns
from zteam.config.resources import find_world
from zteam.geometry import Pose2
from zteam.messages import Twist
from zteam.messages.base import DEFAULT_BASE
from zteam.robot.behaviors.asking import decide
from zteam.robot.behaviors.straight import Forward, ForwardParams
from zteam.robot.safety import SafetyLayer
from zteam.robot.trials.situations import LEADER, ROBOT, lookup_in
from zteam.robot.view import View
from zteam.simulator.core import Engine, Observation
from zteam.simulator.core.to_messages import odometry_message, scan_message
from zteam.simulator.world import World, add_robot, load_world

SECONDS = 10.0
"""Simulated seconds of a trial."""


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


class Drive(NamedTuple):
    """What came of a drive."""

    travelled: float
    """Metres."""
    cut: float
    """Seconds in which the safety layer slowed the robot down or stopped it."""
    contact: float
    """Seconds in which it drove against something."""
    contact_at: Pose2 | None
    """Where that began."""


def drive(step: Callable[[View], tuple[Twist, str]], place: Start, inputs: Mapping[str, Any]) -> Drive:
    """Drive for SECONDS with the velocities and reasons of `step`. `inputs` are what its views hold of its inputs."""
    world, starts = _load(), {LEADER: place.other, ROBOT: place.own}
    robots = {i: add_robot(world, "erratic", pose, names.robot_name(i)) for i, pose in starts.items()}
    engine, tick = Engine(world, robots=robots), world.interval / NS_PER_S
    layers, other = {i: SafetyLayer() for i in robots}, Forward(ForwardParams(place.speed))
    commands: dict[int, Twist] = {}
    at, contacts, travelled, cut = place.own, list[Pose2](), 0.0, 0.0
    for _ in range(round(to_ns(SECONDS) / world.interval)):
        observation = engine.step(commands)
        robot = observation.robots[ROBOT]
        travelled, at = travelled + math.dist(robot.truth[:2], at[:2]), robot.truth
        contacts += [at] if robot.stall else []
        view = _view(observation, ROBOT, tick, inputs)
        wanted, reason = step(view)
        commands[ROBOT], cause = layers[ROBOT].limit(wanted, view, reason)
        cut += tick if cause else 0.0
        commands[LEADER], _reason = decide(other, _view(observation, LEADER, tick, {}), layers[LEADER])
    return Drive(travelled, cut, tick * len(contacts), contacts[0] if contacts else None)


def _view(observation: Observation, robot_id: int, tick: float, inputs: Mapping[str, Any]) -> View:
    now = observation.stamp
    return View(
        now=now,
        dt=tick if observation.tick > 1 else 0.0,
        robot_id=robot_id,
        scan=scan_message(observation, robot_id, 0),
        odom=odometry_message(observation, robot_id),
        lookup=lookup_in({i: robot.truth for i, robot in observation.robots.items()}, now),
        team=tuple(observation.robots),
        bases=dict.fromkeys(observation.robots, DEFAULT_BASE),
        inputs=inputs,
    )


@cache
def _load() -> World:
    return load_world(find_world("arena"))

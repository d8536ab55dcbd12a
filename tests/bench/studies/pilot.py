"""A robot's step as its process does it, without a bus: what has come for it, mux, behaviour, safety layer."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from studies.scenes import Part
from zteam import names
from zteam.behaviors import SafetyLayer, load_behavior
from zteam.messages import (
    BaseInfo,
    Header,
    LaserScan,
    Odometry,
    Point,
    Pose,
    PoseStamped,
    RobotDriver,
    TFMessage,
    Twist,
    Vector3,
)
from zteam.robot.behaviors.behavior import ask, declared_inputs
from zteam.robot.behaviors.registry import find_behavior
from zteam.robot.process.inputs import RobotInputs


class Tick(NamedTuple):
    """What the robots of a scene get in one tick."""

    now: int
    """Nanoseconds."""
    scans: tuple[LaserScan, ...]
    odometries: tuple[Odometry, ...]
    bundle: TFMessage
    """All moving transforms, as the aggregator sends them."""


class Cost(NamedTuple):
    """Nanoseconds of one step."""

    behavior: int
    safety: int
    """With the mux and the view."""


class Pilot:
    """One robot of a scene."""

    def __init__(self, robot_id: int, part: Part, fixed: TFMessage, bases: Mapping[int, BaseInfo]) -> None:
        self._id, self._part = robot_id, part
        self._team = tuple(bases)
        self._behavior = load_behavior(part.behavior, part.parameters, robot_id)
        declared = declared_inputs(find_behavior(part.behavior).inputs, robot_id)
        self._inputs = RobotInputs(robot_id, declared=declared)
        self._inputs.transforms.on_static(fixed)
        for other, base in bases.items():
            self._inputs.on_base_info(other, base)
        self._layer = SafetyLayer()
        self._seconds = 0.0

    def take(self, tick: Tick, dt: float) -> None:
        """Everything of a tick has come, `dt` seconds after the one before."""
        inputs, part = self._inputs, self._part
        inputs.on_scan(tick.scans[self._id])
        inputs.on_odom(tick.odometries[self._id])
        inputs.transforms.on_bundle(tick.bundle)
        if part.goal is not None and not self._seconds:
            (goal,) = inputs.declared.declared
            pose = Pose(Point(*part.goal, 0.0))
            inputs.declared.receive(goal, goal.key, PoseStamped(Header(frame_id=names.MAP_FRAME), pose), tick.now)
        if part.teleop:
            speed, turn = self._asked()
            inputs.mux.receive(RobotDriver.TELEOP, "", Twist(Vector3(speed), Vector3(z=turn)), tick.now)
        self._seconds += dt

    def step(self, now: int, dt: float, times: Iterator[int]) -> tuple[Twist, Cost]:
        """Decide at `now` (ns); `times` tells nanoseconds."""
        inputs = self._inputs
        begin = next(times)
        view = inputs.view(now, dt, self._team)
        choice = inputs.mux.choose(now)
        asked = next(times)
        wanted, reason = ask(self._behavior, view)
        answered = next(times)
        if choice is not None:
            wanted, reason = choice[1], ""
        command, _ = self._layer.limit(wanted, view, reason)
        return command, Cost(answered - asked, next(times) - answered + asked - begin)

    def _asked(self) -> tuple[float, float]:
        """What teleop asks for now."""
        left = self._seconds % sum(part[0] for part in self._part.teleop)
        for seconds, speed, turn in self._part.teleop:
            if left < seconds:
                return speed, turn
            left -= seconds
        return 0.0, 0.0

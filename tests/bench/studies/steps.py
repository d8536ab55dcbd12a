"""The cost of a robot's step, scene by scene.

A scene is driven once in the simulator's core, and what the robots got is kept. Then each robot gets the same again,
time after time. So the cheapest of several rounds is the cost of a step that nothing disturbed, also on a busy machine.
"""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, SupportsFloat

import msgspec
import numpy as np

from studies.hops import ROBOT_BUDGET_US
from studies.scenes import HALL, SCENES, Part, Scene
from zteam import names
from zteam.behaviors import SafetyLayer, load_behavior
from zteam.cli.bench import figure
from zteam.cli.tables import format_table
from zteam.clock import monotonic_times
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
    TransformStamped,
    Twist,
    Vector3,
)
from zteam.robot.behaviors.behavior import ask, declared_inputs
from zteam.robot.behaviors.registry import find_behavior
from zteam.robot.process.inputs import RobotInputs
from zteam.sim import Engine
from zteam.simulator.core.to_messages import odometry_message, scan_message, static_transforms, transforms
from zteam.simulator.world.model import base_info
from zteam.world import World, add_robot, load_world

_REFERENCE_BEAMS = 1081
_REFERENCE_CALLS = 20
_ROUNDS = 7
_LEGEND = [
    "µs of a step with 1081 beams, the least of several rounds: mux and safety layer, behaviour, both; medians.",
    "ratio: both / a fixed piece of Python and numpy on the same machine. In the rows of teleop no behaviour drives.",
]


class StepFigures(msgspec.Struct):
    """One scene: microseconds of a robot's step, over all its measured robots and ticks."""

    scene: str
    robots: int
    """Measured robots."""
    steps: int
    safety_us: float
    """Mux and safety layer, median."""
    behavior_us: float
    """Median."""
    total_us: float
    """Together, median."""
    p90_us: float
    max_us: float
    reference_us: float
    """A fixed piece of Python and numpy that is no part of zteam, measured between the rounds."""
    ratio: float
    """total_us / reference_us."""
    same: bool
    """Whether each round gave the commands of the drive."""


def measure_steps(seconds: float) -> Iterator[StepFigures]:
    """Measure the scenes, one after the other, each driven for so many simulated seconds."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hall.world"
        path.write_text(HALL)
        world = load_world(path)
    ticks = max(2, round(seconds * 1e9 / world.interval))
    return (_measure(name, scene, world, ticks) for name, scene in SCENES.items())


def _measure(name: str, scene: Scene, world: World, ticks: int) -> StepFigures:
    drive = _Drive(scene, world)
    for _ in range(ticks):
        drive.step()
    costs, references, same = [], [], True
    for _ in range(_ROUNDS):
        references.append(_reference())
        steps = [drive.repeat(i) for i in range(scene.measured)]
        same = same and all([command for command, _ in own] == drive.commands[i] for i, own in enumerate(steps))
        costs.append([[cost for _, cost in own] for own in steps])
    # (rounds, robots, ticks, 2) -> (steps, 2), microseconds; the first step prepares much.
    best = np.array(costs).min(axis=0)[:, 1:].reshape(-1, 2) / 1e3
    total = best.sum(axis=1)
    reference = min(references)
    median = float(np.median(total))
    return StepFigures(
        scene=name,
        robots=scene.measured,
        steps=total.size,
        safety_us=_rounded(np.median(best[:, Cost._fields.index("safety")])),
        behavior_us=_rounded(np.median(best[:, Cost._fields.index("behavior")])),
        total_us=_rounded(median),
        p90_us=_rounded(np.percentile(total, 90)),
        max_us=_rounded(total.max()),
        reference_us=_rounded(reference),
        ratio=_rounded(median / reference),
        same=same,
    )


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
            (goal,) = inputs.declared
            pose = Pose(Point(*part.goal, 0.0))
            inputs.on_declared(goal, goal.key, PoseStamped(Header(frame_id=names.MAP_FRAME), pose), tick.now)
        if part.teleop:
            speed, turn = self._asked()
            inputs.on_velocity(RobotDriver.TELEOP, "", Twist(Vector3(speed), Vector3(z=turn)), tick.now)
        self._seconds += dt

    def step(self, now: int, dt: float, times: Iterator[int]) -> tuple[Twist, Cost]:
        """Decide at `now` (ns); `times` tells nanoseconds."""
        inputs = self._inputs
        begin = next(times)
        view = inputs.view(now, dt, self._team)
        choice = inputs.choose(now)
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


class _Drive:
    """A scene in the simulator's core."""

    def __init__(self, scene: Scene, world: World) -> None:
        self._scene = scene
        robots = {i: add_robot(world, "erratic", part.start, names.robot_name(i)) for i, part in enumerate(scene.parts)}
        self._engine = Engine(world, robots=robots, options=scene.options)
        self._fixed = TFMessage(
            [each for i, robot in robots.items() for each in static_transforms(i, robot, robot.pose).transforms]
        )
        self._bases = {i: base_info(robot) for i, robot in robots.items()}
        self._pilots = [self._pilot(i) for i in robots]
        self._dt = world.interval / 1e9
        self.ticks: list[Tick] = []
        self.commands: list[list[Twist]] = [[] for _ in robots]
        """By robot."""

    def _pilot(self, robot_id: int) -> Pilot:
        return Pilot(robot_id, self._scene.parts[robot_id], self._fixed, self._bases)

    def step(self) -> None:
        """One tick more."""
        engine = self._engine
        seen = engine.step({i: own[-1] for i, own in enumerate(self.commands) if own})
        robots = range(len(self._pilots))
        moving: list[TransformStamped] = []
        for i in robots:
            moving += transforms(seen.time, i, seen.robots[i].odom).transforms
        scans = tuple(scan_message(seen, i, 0) for i in robots)
        odometries = tuple(odometry_message(seen, i) for i in robots)
        tick = Tick(engine.now, scans, odometries, TFMessage(moving))
        self.ticks.append(tick)
        times = monotonic_times()
        for i, pilot in enumerate(self._pilots):
            pilot.take(tick, self._dt)
            self.commands[i].append(pilot.step(tick.now, self._dt, times)[0])

    def repeat(self, robot_id: int) -> list[tuple[Twist, Cost]]:
        """The drive again for one robot alone: its commands, and what they cost."""
        pilot, times, found = self._pilot(robot_id), monotonic_times(), []
        for tick in self.ticks:
            pilot.take(tick, self._dt)
            found.append(pilot.step(tick.now, self._dt, times))
        return found


def _reference() -> float:
    """Microseconds of a fixed mixture of numpy calls and plain Python, the best of some."""
    times, values = monotonic_times(), np.linspace(0.1, 30.0, _REFERENCE_BEAMS)
    found = []
    for _ in range(_REFERENCE_CALLS):
        begin = next(times)
        for _ in range(5):
            near = (values < 3.0).nonzero()[0]
            float(np.hypot(values.take(near), 1.0).min())
        sum([i * 0.5 for i in range(200)])
        found.append(next(times) - begin)
    return min(found) / 1e3


def _rounded(value: SupportsFloat) -> float:
    return round(float(value), 2)


def format_steps(rows: Sequence[StepFigures]) -> str:
    """One row a scene."""
    header = ["scene", "robots", "mux, safety", "behaviour", "both", "90 %", "most", "ratio", f"<= {ROBOT_BUDGET_US:g}"]
    cells = [
        [
            row.scene,
            f"{row.robots}",
            *map(figure, (row.safety_us, row.behavior_us, row.total_us, row.p90_us, row.max_us, row.ratio)),
            "yes" if row.total_us <= ROBOT_BUDGET_US else "no",
        ]
        for row in rows
    ]
    return "\n".join([*format_table(header, cells, numbers_from=1).splitlines(), *_LEGEND])

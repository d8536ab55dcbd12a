"""The cost of each step of a tick in Python, measured warm and alone, to compare with a whole tick."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from zteam import names
from zteam.behaviors import SafetyLayer, View, decide, load_behavior
from zteam.cli.bench import figure
from zteam.cli.tables import format_table
from zteam.clock import process_time
from zteam.geometry import Pose2
from zteam.messages import (
    Done,
    Header,
    LaserScan,
    Message,
    Odometry,
    TFMessage,
    Tick,
    TransformStamped,
    Twist,
    decode,
    encode,
    time_from_ns,
)
from zteam.simulator.core import to_messages
from zteam.tf import Buffer
from zteam.world import Robot, add_robot, load_world

ROBOT_BUDGET_US = 150.0
"""Microseconds that the behaviour, the safety layer and what comes between them may take a robot and tick, with 1081
beams: a robot's part of a fast tick in one process."""
_ROUNDS, _TIMES = 5, 200
_TICK = 100_000_000


def _cost(call: Callable[[], object]) -> float:
    """Microseconds per call: the best of several rounds."""
    best = float("inf")
    for _ in range(_ROUNDS):
        begin = process_time()
        for _ in range(_TIMES):
            call()
        best = min(best, process_time() - begin)
    return round(1e6 * best / _TIMES, 2)


def measure_hops(world: Path, robots: int, beams: int) -> dict[str, float]:
    """Microseconds of each step, for a team of so many robots with lasers of so many beams.

    The robots are like the world's first one, or erratics.
    """
    loaded = load_world(world)
    robot = loaded.robots[0] if loaded.robots else add_robot(loaded, "erratic", Pose2(0.0, 0.0, 0.0), "bench")
    far = np.full(beams, 5.0, np.float32)
    scan = LaserScan(
        Header(time_from_ns(_TICK), names.robot_frame(1, names.BASE_LASER_LINK)),
        angle_min=-2.35, angle_max=2.35, angle_increment=4.7 / beams, range_max=30.0, ranges=far, intensities=far,
    )  # fmt: skip
    participants = [names.AGGREGATOR, *map(names.robot_name, range(robots))]
    tick = Tick(time_from_ns(_TICK), 1, 1, np.arange(robots, dtype=np.int32), participants)
    messages: dict[str, Message] = {
        "scan": scan, "tick": tick, "done": Done(1, 1, True), "twist": Twist(), "odometry": Odometry(),
        "four_transforms": TFMessage([TransformStamped(Header(time_from_ns(1), "robot_0/odom"), "robot_0/base")] * 4),
    }  # fmt: skip
    payload = encode(scan)
    bundle = _Bundles(robot, robots)
    behavior, layer = load_behavior("follow", {"leader": 0}, 1), SafetyLayer()

    def act() -> object:
        now = bundle.now
        fresh = decode(LaserScan, payload)
        fresh.header.stamp = time_from_ns(now)
        view = View(now=now, dt=0.1, robot_id=1, scan=fresh, odom=Odometry(), lookup=bundle.look)
        return decide(behavior, view, layer)

    found = {}
    for name, message in messages.items():
        found[f"encode_{name}"] = _cost(partial(encode, message))
        found[f"decode_{name}"] = _cost(partial(decode, type(message), encode(message)))
    return {
        **found,
        "encode_bundle": _cost(bundle.encode),
        "take_bundle_and_look_up_two": _cost(bundle.take_and_look),
        "look_up": _cost(lambda: bundle.look(names.MAP_FRAME, names.robot_frame(1, names.BASE_FOOTPRINT))),
        "behavior_and_safety": round(_cost(act) - _cost(lambda: decode(LaserScan, payload)), 2),
    }


def format_hops(found: dict[str, float]) -> str:
    """One row a step."""
    rows = [(name.replace("_", " "), f"{figure(cost)} µs") for name, cost in found.items()]
    budget = f"behaviour and safety: budget {ROBOT_BUDGET_US:g} µs a robot and tick"
    return "\n".join([format_table(("step of a tick, alone", "time"), rows), budget])


class _Bundles:
    """A team's transforms as its robots receive them."""

    def __init__(self, robot: Robot, robots: int) -> None:
        self.now = 0
        self._robots = range(robots)
        self._buffer = Buffer()
        for i in self._robots:
            for fixed in to_messages.static_transforms(i, robot, Pose2(float(i), 0.0, 0.0)).transforms:
                self._buffer.set_transform_static(fixed, names.TF)
        self._payloads = [encode(self._bundle(tick)) for tick in range(1, 2 + _ROUNDS * _TIMES)]
        self._message = self._bundle(1)
        self._next = 0
        self.take_and_look()

    def _bundle(self, tick: int) -> TFMessage:
        found: list[TransformStamped] = []
        for i in self._robots:
            found += to_messages.transforms(time_from_ns(tick * _TICK), i, Pose2(0.01 * tick, 0.0, 0.0)).transforms
        return TFMessage(found)

    def encode(self) -> bytes:
        """Encode a bundle, as the aggregator does."""
        return encode(self._message)

    def take_and_look(self) -> None:
        """Take a bundle, then look up a follower's own pose and its leader's, as a follower does."""
        self._buffer.set_transforms(decode(TFMessage, self._payloads[self._next]).transforms, names.TF)
        self._next += 1
        self.now = self._next * _TICK
        own, leader = (names.robot_frame(i, names.BASE_FOOTPRINT) for i in (1, 0))
        self.look(names.MAP_FRAME, own)
        self.look(own, leader)

    def look(self, target: str, source: str) -> tuple[Pose2, int]:
        """The newest pose of `source` in `target` and its stamp (ns)."""
        return self._buffer.lookup_pose2(target, source, 0)

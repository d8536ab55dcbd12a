"""`zteam.TransformListener` in a node on a bus in memory: what its look-ups answer inside `step`."""

from typing import Any

import pytest

import zteam
from support.transforms import stamped
from zteam.bus import MemoryHub
from zteam.errors import BusError
from zteam.messages import TFMessage, TransformStamped
from zteam.testing import run_node
from zteam.tf import ExtrapolationException, LookupException

TICK = 100_000_000


class Watch:
    """A node that looks one pair up at each step, at the step's own time."""

    def __init__(self, target: str = "map", source: str = "robot_0/base_footprint") -> None:
        self.pair = target, source
        self.xs: list[float] = []
        self.listener: Any = None

    def __call__(self, node: zteam.Node) -> None:
        self.listener = zteam.TransformListener(node)
        node.run(self.step)

    def step(self, now: int) -> None:
        """Remember x."""
        pose, stamp = self.listener.lookup_pose2(*self.pair, now)
        assert stamp == now
        self.xs.append(pose.x)


def start(x: float = 10.0, robot: int = 0) -> TFMessage:
    """The start pose of a robot."""
    return TFMessage([stamped("map", f"robot_{robot}/odom", 0, x)])


def moved(x: float, *robots: int) -> TFMessage:
    """A bundle of some robots' odometry."""
    return TFMessage([stamped(f"robot_{i}/odom", f"robot_{i}/base_footprint", 0, x) for i in robots])


@pytest.mark.parametrize("ahead", [None, 0, 5 * TICK])
def test_a_step_waits_for_the_bundle_of_its_tick(ahead: int | None) -> None:
    """Older transforms, and a frame that another process puts onto `tf`, of this tick or of the future, do not let the
    step run; what needs them is named."""
    watch = Watch()
    with run_node(watch, MemoryHub(), name="watch", robots=[0]) as running:
        running.publish("tf_static", start())
        running.publish("tf", moved(1.0, 0))
        running.tick()
        if ahead is not None:
            running.publish("tf", TFMessage([stamped("map", "carrot", 2 * TICK + ahead)]))
        with pytest.raises(BusError, match=r"watch waits for inputs of 0\.2 s: .*TransformListener"):
            running.tick()
        assert watch.xs == [11.0]


def test_a_step_waits_for_the_fixed_transforms() -> None:
    """The first step waits until every robot of the world has a place in the map, whichever message comes last."""
    watch = Watch("robot_0/base_footprint", "robot_1/base_footprint")
    with run_node(watch, MemoryHub(), robots=[0, 1]) as running:
        running.publish("tf_static", start(10.0, 0))
        running.publish("tf", moved(1.0, 0, 1))
        with pytest.raises(BusError):
            running.tick()
        both = [*start(10.0, 0).transforms, *start(12.0, 1).transforms]
        running.publish("tf_static", TFMessage(both))
        assert watch.xs == [2.0]


def test_a_reset_forgets_the_old_time() -> None:
    """After a reset the old moving transforms are gone, the fixed ones still count."""
    watch = Watch()
    with run_node(watch, MemoryHub(), robots=[0]) as running:
        running.publish("tf_static", start())
        for x in (1.0, 2.0, 3.0):
            running.publish("tf", moved(x, 0))
            running.tick()
        running.reset()
        assert watch.listener.can_transform("map", "robot_0/odom") == (True, "")
        assert not watch.listener.can_transform("map", "robot_0/base_footprint")[0]
        running.publish("tf", moved(5.0, 0))
        running.tick()
    assert watch.xs == [11.0, 12.0, 13.0, 15.0]


def test_a_late_bundle_of_the_old_time_is_not_that_of_the_tick() -> None:
    """The aggregator may send its last bundle again before it hears of a reset; the step still waits for its own."""
    watch = Watch()
    with run_node(watch, MemoryHub(), robots=[0]) as running:
        running.publish("tf_static", start())
        for x in (1.0, 2.0):
            last = moved(x, 0)
            running.publish("tf", last)
            running.tick()
        running.reset()
        running.bus.publisher("tf", TFMessage).put(last)
        with pytest.raises(BusError, match=r"waits for inputs of 0\.1 s"):
            running.tick()
        assert watch.xs == [11.0, 12.0]


def test_look_ups_answer_like_tf2s_buffer() -> None:
    """The newest transform without a time, tf2's exceptions where there is none, and all else on `buffer`."""
    found: list[Any] = []

    def main(node: zteam.Node) -> None:
        listener = zteam.TransformListener(node)

        def step(now: int) -> None:
            transform = listener.lookup_transform("map", "robot_0/base_footprint")
            assert isinstance(transform, TransformStamped)
            found.append(transform.transform.translation.x)
            with pytest.raises(LookupException):
                listener.lookup_pose2("map", "robot_7/base_footprint")
            with pytest.raises(ExtrapolationException):
                listener.lookup_transform("map", "robot_0/base_footprint", now + 1)
            found.append(listener.can_transform("map", "robot_7/base_footprint")[0])
            found.append(listener.buffer.latest_common_time("map", "robot_0/base_footprint"))

        node.run(step)

    with run_node(main, MemoryHub(), robots=[0]) as running:
        running.publish("tf_static", start())
        running.publish("tf", moved(2.0, 0))
        running.tick()
    assert found == [12.0, False, TICK]

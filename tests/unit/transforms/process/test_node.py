"""The aggregator on a bus in memory: the latched fixed set, its queries, conflicts, jumps in time."""

import pytest

from support.aggregator_desk import Base, Desk, Listener, S, look_up
from support.log_capture import LogCapture
from support.transforms import stamped
from zteam import names
from zteam.bus import MemoryHub
from zteam.messages import Clock, TFMessage, decode, time_from_ns
from zteam.tf import FrameInfo
from zteam.transforms.client import BundleReply


def test_the_fixed_set_is_latched_and_whole(hub: MemoryHub) -> None:
    """The team file's and every robot's fixed transforms, in one message that late subscribers get too, and that is
    sent again when one of them has changed."""
    base = Base(hub, 0)
    base.stand(1.0)
    desk = Desk(hub, (stamped("robot_0/base_link", "robot_0/camera", 0, 0.1),))
    Base(hub, 1).stand(2.0)
    listener = Listener(hub)
    for x in (1.0, 3.0, 3.0):
        base.stand(x)
    others = {"robot_0/camera": 0.1, "robot_1/odom": 2.0}
    assert listener.statics == [{**others, "robot_0/odom": 1.0}, {**others, "robot_0/odom": 3.0}]
    desk.end()


@pytest.mark.usefixtures("desk")
def test_a_localiser_takes_over_with_its_bundle(hub: MemoryHub) -> None:
    """The start pose has left the fixed set when the bundle with the localiser's pose comes."""
    listener, base, seen = Listener(hub), Base(hub, 0), list[dict[str, float]]()
    hub.bus().subscribe(names.TF, TFMessage, lambda *_: seen.append(listener.statics[-1]))
    base.stand(1.0)
    assert listener.statics == [{"robot_0/odom": 1.0}]
    base.tf.put(TFMessage([stamped("map", "odom", S, 2.0)]))
    assert seen == [{}]


@pytest.mark.usefixtures("desk")
def test_look_ups_are_answered(hub: MemoryHub) -> None:
    """The pose and its stamp; the name of tf2's exception and a text where there is none; and the tree's frames."""
    base = Base(hub, 0)
    base.stand(1.0)
    base.drive(S, 0.0)
    base.drive(2 * S, 1.0)
    newest = look_up(hub, "map", "/robot_0/base_footprint")
    assert (newest.stamp, newest.translation, newest.error) == (2 * S, (2.0, 0.0, 0.0), "")
    assert newest.rotation == (0.0, 0.0, 0.0, 1.0)
    late = look_up(hub, "map", "robot_0/base_footprint", 3 * S)
    assert late.error == "ForwardExtrapolationException"
    assert late.text
    found = hub.bus().ask(names.service_key(names.AGGREGATOR, "frames"), dict[str, FrameInfo])
    assert [(child, info.parent, info.static) for child, info in found.items()] == [
        ("robot_0/base_footprint", "robot_0/odom", False),
        ("robot_0/odom", "map", True),
    ]
    assert found["robot_0/base_footprint"].authority == "robot_0"


@pytest.mark.usefixtures("desk")
def test_the_newest_bundle_can_be_asked_for(hub: MemoryHub) -> None:
    """It is the one that was sent last, as bytes."""
    sent: list[TFMessage] = []
    hub.bus().subscribe(names.TF, TFMessage, lambda _key, bundle: sent.append(bundle))
    base = Base(hub, 0)
    base.stand(1.0)
    for tick in range(1, 4):
        base.drive(tick * S // 10)
    found = hub.bus().ask(names.service_key(names.AGGREGATOR, "newest"), BundleReply)
    assert decode(TFMessage, found.content) == sent[-1]


def test_a_conflict_is_logged_once_with_both_sides(hub: MemoryHub, log: LogCapture) -> None:
    """Robot 0 contradicts the team file many times: one line names both, and the file's frame stays."""
    desk, listener = Desk(hub, (stamped("robot_0/base_link", "robot_0/camera", 0, 0.1),)), Listener(hub)
    base, other = Base(hub, 0), Base(hub, 1)
    desk.start()
    for tick in range(1, 20):
        base.tf_static.put(TFMessage([stamped("base_link", "camera", 0, 0.2)]))
        base.drive(tick * S)
        other.drive(tick * S)
    count = len(listener.bundles)
    other.drive(20 * S)
    listener.wait_for_bundles(count + 1)
    desk.end()
    (line,) = [line for line in log.lines if "robot_0/camera" in line]
    assert "team_file" in line
    assert f"by session:{base.bus.instance}" in line
    assert listener.statics[-1]["robot_0/camera"] == 0.1


@pytest.mark.usefixtures("desk")
def test_a_jump_back_forgets_what_moves(hub: MemoryHub, log: LogCapture) -> None:
    """A restarted simulator's transforms are taken at once, the fixed ones stay, and the log says so."""
    clock = hub.bus().publisher(names.CLOCK, Clock)
    listener, base = Listener(hub), Base(hub, 0)
    base.stand(1.0)
    clock.put(Clock(time_from_ns(500 * S)))
    base.drive(500 * S, 5.0)
    clock.put(Clock(time_from_ns(S)))
    assert look_up(hub, "map", "robot_0/base_footprint").error
    assert [line for line in log.lines if "jumped back" in line] == [
        "time jumped back from 500.0 s to 1.0 s: moving transforms are forgotten"
    ]
    base.drive(S, 2.0)
    assert listener.bundles[-1] == [("robot_0/base_footprint", S)]
    assert look_up(hub, "map", "robot_0/base_footprint").translation[0] == 3.0


@pytest.mark.usefixtures("desk")
def test_nonsense_changes_nothing(hub: MemoryHub, desk: Desk) -> None:
    """Garbage, a wildcard key, a robot that speaks for another, an empty message: nothing is sent on."""
    listener = Listener(hub)
    raw = hub.bus().transport
    for key in ("robot_0/tf", "robot_0/tf_static"):
        raw.declare_publisher(key, "", False).put(b"\x00\x01\x00\x00\xff\xff\xff\xff")
    for key in ("robot_0/tf", "robot_01/tf", "robot_x/tf"):
        hub.bus().publisher(key, TFMessage).put(TFMessage([stamped("robot_1/odom", "/robot_1/base", S)]))
        hub.bus().publisher(key, TFMessage).put(TFMessage())
    assert listener.bundles == []
    assert listener.statics == []
    counts = desk.node.bus.counters.snapshot()
    assert [counts[key].dropped for key in ("robot_0/tf", "robot_0/tf_static")] == [1, 1]

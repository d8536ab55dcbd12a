"""What one robot's navigation publishes."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from zteam import names
from zteam.bus import MemoryHub
from zteam.clock import to_ns
from zteam.geometry import Pose2
from zteam.messages import Header, OccupancyGrid, Path, PoseStamped, TFMessage, encode, ns_from_time, time_from_ns
from zteam.messages.base import DEFAULT_BASE
from zteam.messages.planar import pose_message
from zteam.navigation.planning.grid import make_map
from zteam.navigation.planning.parameters import Parameters, WindowOptions
from zteam.navigation.process.costmaps import Costmaps
from zteam.navigation.process.outputs import Outputs
from zteam.node.node import Node
from zteam.node.shutdown import Stop


def test_each_frame_of_a_localiser_has_a_later_stamp() -> None:
    """In real time a step may come late, and the next one soon: no stamp is sent twice, which the tree would refuse."""
    hub, stamps = MemoryHub(), list[int]()
    hub.bus().subscribe(
        names.robot_key(0, names.TF),
        TFMessage,
        lambda _key, message: stamps.append(ns_from_time(message.transforms[0].header.stamp)),
    )
    outputs = Outputs(Node("nav_0", hub.bus(), Stop()), 0, Parameters())
    localiser: Any = SimpleNamespace(map_from_odom=Pose2(1.0, 2.0, 0.0), pose=None)
    for now, ahead in ((5.0, 0.1), (5.2, 0.2), (5.3, 0.1), (5.3, 0.1), (5.4, 0.1)):
        outputs.localise(to_ns(now), to_ns(ahead), localiser)
    assert [stamps[0], stamps[1], stamps[-1]] == [to_ns(5.1), to_ns(5.4), to_ns(5.5)]
    assert stamps == sorted(set(stamps))
    outputs.forget()
    outputs.localise(to_ns(0.1), to_ns(0.1), localiser)
    assert stamps[-1] == to_ns(0.2)


@pytest.mark.parametrize(("frequency", "count"), [(1.0, 5), (0.0, 1)])
def test_a_costmap_is_sent_at_its_frequency_and_once_at_0(frequency: float, count: int) -> None:
    """As Nav2's files have it, 0 is no frequency: a subscriber gets one."""
    hub, sizes = MemoryHub(), list[int]()
    hub.bus().subscribe(
        names.robot_key(0, names.LOCAL_COSTMAP), OccupancyGrid, lambda _key, message: sizes.append(message.info.width)
    )
    parameters = Parameters(local_window=WindowOptions(publish_frequency=frequency))
    outputs = Outputs(Node("nav_0", hub.bus(), Stop()), 0, parameters)
    costmaps = Costmaps(parameters, DEFAULT_BASE, make_map(np.zeros((9, 9), np.int8), 0.1))
    for tick in range(50):
        outputs.show_costmaps(to_ns(0.1 * tick), costmaps)
    assert sizes == [60] * count


@pytest.mark.parametrize("count", [0, 1, 2, 300])
def test_a_plan_is_sent_as_a_message_of_its_poses(count: int) -> None:
    """The same bytes as of a Path that is made pose by pose."""
    hub, found, path = MemoryHub(), list[Path](), np.random.default_rng(count).normal(0.0, 2.0, (count, 3))
    hub.bus().subscribe(names.robot_key(0, names.PLAN), Path, lambda _key, message: found.append(message))
    navigator: Any = SimpleNamespace(path=path)
    costmaps: Any = None
    Outputs(Node("nav_0", hub.bus(), Stop()), 0, Parameters()).show(to_ns(5.1), navigator, None, costmaps)
    header = Header(time_from_ns(to_ns(5.1)), "map")
    poses = [PoseStamped(header, pose_message(Pose2(*pose))) for pose in path.tolist()]
    assert [encode(message) for message in found] == [encode(Path(header, poses))]

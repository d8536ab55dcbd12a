"""Changes of the world: the engine, the publishers and the count of a run follow."""

from collections.abc import Iterator

import msgspec
import pytest

from support.simulator_parts import SimulatorParts
from zteam import names
from zteam.bus import MemoryHub
from zteam.errors import UsageError
from zteam.messages import BaseInfo, LaserScan, TFMessage
from zteam.services.simulator import MoveRequest, SpawnRequest


@pytest.fixture
def parts(hub: MemoryHub) -> Iterator[SimulatorParts]:
    """A simulator after its first tick, without a main loop."""
    made = SimulatorParts(hub)
    made.whole_tick()
    yield made
    made.close()


def test_a_new_robot_gets_the_lowest_free_id_and_publishers(parts: SimulatorParts) -> None:
    """Its scans come with the next tick."""
    scans = parts.record(names.scan_key(3, 0), LaserScan)
    assert parts.spawn(SpawnRequest(-3.5, -1.5)) == 3
    assert list(parts.outputs) == [0, 1, 2, 3]
    parts.whole_tick()
    assert scans == [names.scan_key(3, 0)]


def test_a_robot_that_leaves_publishes_no_more(parts: SimulatorParts) -> None:
    """Its id is free again, and a repeat does not send it either."""
    scans = parts.record(names.scan_key(1, 0), LaserScan)
    parts.remove(1)
    parts.repeat()
    parts.whole_tick()
    assert (list(parts.outputs), scans) == ([0, 2], [])
    assert parts.spawn(SpawnRequest(-3.5, -1.5)) == 1


def test_a_moved_robot_has_new_fixed_frames(parts: SimulatorParts) -> None:
    """Its `odom` frame has another origin in `map`."""
    frames = parts.record(names.robot_key(0, names.TF_STATIC), TFMessage)
    parts.move(MoveRequest(0, -3.5, -1.5))
    assert frames[-1:] == [names.robot_key(0, names.TF_STATIC)]
    assert parts.engine.truth(0)[:2] == (-3.5, -1.5)


def test_every_robot_tells_its_base_and_a_new_one_anew(parts: SimulatorParts, hub: MemoryHub) -> None:
    """A late subscriber gets it; a robot of the same id and another model tells its own, also when a reset makes it."""
    told: list[str] = []
    hub.bus().subscribe(names.robot_key(1, names.BASE_INFO), BaseInfo, lambda _, m: told.append(m.model), latched=True)
    assert told == ["erratic"]
    small = msgspec.structs.replace(parts.engine.robots[1], model="small")
    parts.remove(1)
    parts.engine.spawn(1, small)
    parts.outputs.match_robots()
    assert told == ["erratic", "small"]
    parts.reset()
    assert told == ["erratic", "small", "erratic"]
    parts.move(MoveRequest(1, -3.5, -1.5))
    assert told == ["erratic", "small", "erratic"]


def test_a_refused_change_changes_nothing(parts: SimulatorParts) -> None:
    """A robot or a model that is not there, and an id that is taken: the error names it."""
    before = [parts.engine.truth(robot_id) for robot_id in parts.outputs]
    with pytest.raises(UsageError, match="robot 9"):
        parts.remove(9)
    with pytest.raises(UsageError, match="robot 9"):
        parts.move(MoveRequest(9, -3.5, -1.5))
    with pytest.raises(UsageError, match="robot 1"):
        parts.spawn(SpawnRequest(-3.5, -1.5, id=1))
    with pytest.raises(UsageError, match="unicorn"):
        parts.spawn(SpawnRequest(-3.5, -1.5, model="unicorn"))
    assert list(parts.outputs) == [0, 1, 2]
    assert [parts.engine.truth(robot_id) for robot_id in parts.outputs] == before


def test_a_place_without_room_is_refused_unless_forced(parts: SimulatorParts) -> None:
    """A wall, another robot, outside of the world: the error has the reason. With force the robot stands there."""
    x, y, _ = parts.engine.truth(1)
    for pose, why in (((-4.95, 0.0), "'west'"), ((x, y), "in robot 1"), ((40.0, 0.0), "outside of the world")):
        with pytest.raises(UsageError, match=f"no room.*{why}.*--force"):
            parts.move(MoveRequest(0, *pose))
        with pytest.raises(UsageError, match=f"no room.*{why}.*--force"):
            parts.spawn(SpawnRequest(*pose))
    assert list(parts.outputs) == [0, 1, 2]
    assert parts.spawn(SpawnRequest(-4.95, 3.0, force=True)) == 3
    parts.move(MoveRequest(0, 0.0, -4.95, force=True))
    for _ in range(30):
        parts.whole_tick()
    assert parts.engine.truth(0)[:2] == pytest.approx((0.0, -4.95))
    assert parts.engine.truth(3)[:2] == pytest.approx((-4.95, 3.0))


def test_a_reset_tells_every_part(parts: SimulatorParts) -> None:
    """Robots that came are gone, and the next tick is the first one."""
    parts.spawn(SpawnRequest(-3.5, -1.5))
    parts.reset()
    assert (parts.engine.tick, list(parts.outputs), parts.is_counting) == (0, [0, 1, 2], False)

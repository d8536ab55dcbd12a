"""A new sensor is a message type, and a row each in `zteam.messages.topics`, `zteam.simulator.world.devices`,
`zteam.simulator.core.devices` and `zteam.simulator.core.to_messages`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import msgspec
import pytest

from zteam.bus import MemoryHub
from zteam.messages import Header, Message, TFMessage, topics
from zteam.messages.message import all_types, float64
from zteam.messages.topics import type_of_key
from zteam.sim import Engine, Observation
from zteam.simulator.core import devices as sensing
from zteam.simulator.core import to_messages
from zteam.simulator.core.casting import SensedWorld
from zteam.simulator.process.outputs import TeamOutputs
from zteam.simulator.world import devices as parsing
from zteam.simulator.world.model import Device
from zteam.simulator.world.properties import Pose3, Reader
from zteam.world import load_world

WORLD = """
position ( size [0.4 0.4 0.3] thermometer ( pose [0.1 0 0 90] offset 3 ) thermometer ( colour 2 ) )
"""


class Thermometer(Device, frozen=True):
    """Plain data."""

    offset: float


def read_thermometer(reader: Reader, name: str, seat: Pose3) -> list[Thermometer]:
    """Parsing."""
    return [Thermometer(name, *seat, reader.number("offset", 0.0))]


def prepare(scene: SensedWorld, owned: Sequence[tuple[int, Thermometer]]) -> sensing.Sense:
    """Sensing: 20 degrees, one more for each metre along x."""
    return lambda poses: [20.0 + float(poses[i, 0]) + thermometer.offset for i, thermometer in owned]


class Temperature(Message):
    """The message type."""

    ros_type: ClassVar[str] = "test_msgs/msg/Temperature"
    header: Header = msgspec.field(default_factory=Header)
    degrees: float64 = 0.0


KIND = parsing.DeviceKind(
    "temperature",
    lambda robot: robot.devices_of(Thermometer),
    "thermometer_link",
    "thermometers",
)


def temperature_message(observation: Observation, robot_id: int, index: int) -> Temperature:
    """The message builder."""
    degrees = observation.robots[robot_id].detections[KIND.topic][index]
    return Temperature(to_messages.header(observation, KIND, robot_id, index), degrees)


@pytest.fixture
def rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rows of the sensor, for one test."""
    monkeypatch.setitem(topics.SENSORS, KIND.topic, Temperature)
    monkeypatch.setitem(parsing.KINDS, KIND.topic, KIND)
    monkeypatch.setitem(parsing.MODELS, "thermometer", parsing.DeviceModel(read_thermometer, {"offset"}))
    monkeypatch.setitem(sensing.PREPARE, KIND.topic, prepare)
    monkeypatch.setitem(to_messages.BUILDERS, KIND.topic, temperature_message)


@pytest.mark.usefixtures("rows")
def test_a_row_parses_senses_publishes_and_types_a_sensor(tmp_path: Path) -> None:
    """Two sensors from a world file come over two keys with their frames, transforms and type; odd properties warn."""
    path = tmp_path / "x.world"
    path.write_text(WORLD)
    world = load_world(path)
    assert [remark.text for remark in world.warnings] == [
        "unknown property 'colour' is ignored (did you mean 'color'?)"
    ]
    hub = MemoryHub()
    heard: list[tuple[str, Any]] = []
    listener = hub.bus()
    for key in ("robot_0/temperature", "robot_0/temperature_1"):
        assert type_of_key(key) is Temperature
        listener.subscribe(key, Temperature, lambda key, message: heard.append((key, message)))
    engine = Engine(world)
    outputs = TeamOutputs(hub.bus(), engine)
    outputs.match_robots()
    outputs[0].put_rest(engine.observe())
    assert [(key, message.degrees, message.header.frame_id) for key, message in heard] == [
        ("robot_0/temperature", 23.0, "robot_0/thermometer_link"),
        ("robot_0/temperature_1", 20.0, "robot_0/thermometer_link_1"),
    ]
    statics: TFMessage = to_messages.static_transforms(0, world.robots[0], engine.odom_origin(0))
    links = [t.child_frame_id for t in statics.transforms if "thermometer" in t.child_frame_id]
    assert links == ["robot_0/thermometer_link", "robot_0/thermometer_link_1"]


def test_every_row_has_a_type_a_builder_and_a_key() -> None:
    """Each kind of device has one sensor row under the same topic, and tools know the type of its key."""
    assert parsing.KINDS.keys() == to_messages.BUILDERS.keys() == topics.SENSORS.keys()
    for kind in parsing.KINDS.values():
        assert type_of_key(kind.key(7, 0)) is type_of_key(kind.key(7, 3)) is kind.message
        assert kind.message in all_types().values()

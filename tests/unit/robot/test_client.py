"""The client of parameters where a robot is not there or does not answer."""

import pytest

from zteam import names
from zteam.bus import MemoryHub, NoRequest
from zteam.errors import BusError
from zteam.node.process_node import ProcessNode
from zteam.node.shutdown import Stop
from zteam.robot.behaviors.straight import Forward
from zteam.robot.client import DESCRIBE, ParametersClient
from zteam.robot.process.parameters import BehaviorParameters

NAME = "robot_1"


def test_a_robot_that_is_not_there_is_named(hub: MemoryHub) -> None:
    """The error lists the robots that there are, or says how to start some."""
    client = ParametersClient(hub.bus())
    with pytest.raises(BusError, match=r"^no process robot_7, and no other .* start a team with 'zteam up'$"):
        client.describe("robot_7")
    node = ProcessNode(NAME, hub.bus(), Stop())
    node.become_present()
    BehaviorParameters(node, Forward, "forward", {})
    text = r"^no process robot_7 with parameters; there is robot_1$"
    with pytest.raises(BusError, match=text):
        client.describe("robot_7")
    with pytest.raises(BusError, match=text):
        client.set("robot_7", {"speed": 0.1})


def test_a_robot_that_does_not_answer_is_named(hub: MemoryHub) -> None:
    """Zenoh's time-out becomes a sentence with the next step."""

    def refuse(_request: NoRequest) -> None:
        raise BusError("Timeout")

    hub.bus().serve(names.service_key(NAME, DESCRIBE), NoRequest, refuse)
    client = ParametersClient(hub.bus())
    with pytest.raises(BusError, match=r"^robot_1: does not answer within 10 s: see 'zteam doctor'$"):
        client.describe(NAME)
    with pytest.raises(BusError, match=r"^no robot answers within 10 s: see 'zteam doctor'$"):
        client.describe_all()
    with pytest.raises(BusError, match=r"^no process robot_7 with parameters; no robot answers within 10 s"):
        client.describe("robot_7")

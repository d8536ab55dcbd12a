"""What the doctor learns of stamps."""

import pytest

from zteam.bus.transport import RawSample
from zteam.clock import monotonic, to_ns, wall_ns
from zteam.messages import Header, Message, Odometry, TFMessage, TransformStamped, Twist, time_from_ns
from zteam.monitor.doctor.collecting import find_leads


def test_stamps_are_compared_with_the_clock_of_this_host() -> None:
    """Of what bases send while the doctor listens, at the moment when it came; a stamp of 0 is decades behind."""

    def header(seconds: float) -> Header:
        return Header(time_from_ns(wall_ns() + to_ns(seconds)))

    newest: dict[str, Message] = {
        "robot_0/odom": Odometry(header(-3605.0)),
        "robot_0/tf": TFMessage([TransformStamped(header(95.0))]),
        "robot_1/odom": Odometry(),
        "robot_1/tf": TFMessage([]),
        "robot_1/cmd_vel": Twist(),
        "robot_2/odom": Odometry(header(-3600.0)),
        "tf": TFMessage([TransformStamped(header(-50.0))]),
    }
    samples = {key: (RawSample(key, message, "", source="a"), message) for key, message in newest.items()}
    now = monotonic()
    arrivals = {("a", key): [now - 99.0, now - 5.0] for key in newest if key != "robot_2/odom"}
    found = find_leads(samples, arrivals)
    assert found.pop("robot_1/odom") < -1e9
    assert found == {"robot_0/odom": pytest.approx(-3600.0, abs=1.0), "robot_0/tf": pytest.approx(100.0, abs=1.0)}

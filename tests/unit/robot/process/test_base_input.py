"""The robot's knowledge of its base, and how long it waits for it."""

import logging

import pytest

from support.world_texts import box_points
from zteam.messages import BaseInfo, Point32, Polygon
from zteam.messages.base import DEFAULT_BASE, BaseOverride
from zteam.robot.process import inputs as module
from zteam.robot.process.inputs import RobotInputs

WIDE = BaseInfo(model="wide", footprint=Polygon([Point32(x, y) for x, y in box_points(0.6)]), max_vel_x=0.5)


@pytest.fixture
def seconds(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The host's clock, by hand: its last number is now."""
    now = [100.0]
    monkeypatch.setattr(module, "monotonic", lambda: now[-1])
    return now


def test_the_default_holds_until_the_base_tells() -> None:
    """A robot is not ready without `base_info`, and has a footprint all the same (`--no-gate`)."""
    known = RobotInputs(3)
    assert known.base.footprint == DEFAULT_BASE.footprint
    assert known.missing() == ["its footprint (robot_3/base_info)"]
    known.on_base_info(3, WIDE)
    assert known.missing() == []
    assert (known.base.half_width, known.base.max_vel_x) == (0.6, 0.5)


def test_the_newest_message_counts_below_the_override() -> None:
    """A base that changes tells so; what the team file sets holds for each of them, and before the first."""
    known = RobotInputs(0, BaseOverride(max_vel_x=0.3))
    assert known.base.max_vel_x == 0.3
    known.on_base_info(0, BaseInfo(model="narrow"))
    known.on_base_info(0, WIDE)
    assert (known.base.model, known.base.half_width, known.base.max_vel_x) == ("wide", 0.6, 0.3)


def test_a_base_that_tells_nothing_is_waited_for_two_seconds(
    seconds: list[float], caplog: pytest.LogCaptureFixture
) -> None:
    """From the first scan on, not from the start; then the default holds, which is said once."""
    known = RobotInputs(0)
    with caplog.at_level(logging.WARNING, "zteam"):
        for now in (100.0, 101.0, 102.0):
            seconds.append(now)
            known.wait_no_longer()
            assert known.missing() == ["its footprint (robot_0/base_info)"]
        for now in (102.1, 103.0):
            seconds.append(now)
            known.wait_no_longer()
    assert known.missing() == []
    (record,) = caplog.records
    assert record.getMessage().startswith("no robot_0/base_info: an erratic's footprint and limits hold")
    # It may come later all the same.
    known.on_base_info(0, WIDE)
    assert known.base.half_width == 0.6


def test_a_base_that_has_told_is_not_missed_later(seconds: list[float], caplog: pytest.LogCaptureFixture) -> None:
    """No warning comes, however long the robot drives."""
    known = RobotInputs(0)
    known.wait_no_longer()
    known.on_base_info(0, WIDE)
    seconds.append(900.0)
    known.wait_no_longer()
    assert caplog.records == []

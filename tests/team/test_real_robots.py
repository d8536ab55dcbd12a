"""`world = "none"`: a team without a simulator, with the team file and the base driver of docs/real-robots.md."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.limits import LIMIT
from zteam.geometry import quaternion_from_rpy
from zteam.messages import (
    BaseInfo,
    Header,
    Quaternion,
    TFMessage,
    Transform,
    TransformStamped,
)
from zteam.team.testing.team import TeamFixture

pytestmark = [pytest.mark.team, pytest.mark.real_time]

PAGE = Path(__file__).parents[2] / "docs" / "real-robots.md"
WALL = 2.0
"""Metres ahead of the start: the wall of the page's simulated base."""


def block(language: str, name: str) -> str:
    """The page's code block that begins with a comment of this file name."""
    (found,) = re.findall(rf"```{language}\n(# {name}.*?)```", PAGE.read_text(), re.DOTALL)
    return str(found)


def x_of(team: TeamFixture) -> float:
    """Metres from the start, by the base's own odometry."""
    odom = team.robot(0).odom
    return 0.0 if odom is None else odom.pose.pose.position.x


def wait_for_x(team: TeamFixture, x: float) -> None:
    """Wait until the robot is so far."""
    team.wait_for(lambda: x_of(team) > x)


def wait_for_text(team: TeamFixture, text: str) -> None:
    """Wait until the robot's status says this."""
    team.wait_for(lambda: team.robot(0).status is not None and team.robot(0).status.text == text)


def wait_for_stand(team: TeamFixture) -> None:
    """Wait until the wheels stand, by the base's own odometry."""
    team.wait_for(lambda: team.robot(0).odom is not None and team.robot(0).odom.twist.twist.linear.x == 0.0)


@pytest.fixture
def base(team: TeamFixture, tmp_path: Path) -> Iterator["subprocess.Popen[str]"]:
    """The page's base driver, as a process of its own beside the team."""
    path = tmp_path / "base_0.py"
    path.write_text(block("python", "base_0.py"))
    with subprocess.Popen(
        [sys.executable, str(path)],
        env={**os.environ, **team.environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        yield process
        process.kill()


def test_a_base_of_ones_own_drives_and_stops(team: TeamFixture, base: "subprocess.Popen[str]", tmp_path: Path) -> None:
    """It drives after GO, stands while its robot's process is frozen, and stops in front of the wall."""
    (tmp_path / "real.toml").write_text(block("toml", "real.toml"))
    bases: list[str] = []
    team.bus.subscribe("robot_0/base_info", BaseInfo, lambda _key, told: bases.append(told.model), latched=True)
    team.launch(tmp_path / "real.toml")
    wait_for_x(team, 0.05)
    team.pause_process("robot_0")
    wait_for_stand(team)
    # The watchdog, and not the wall.
    stood = x_of(team)
    assert stood < WALL - 0.6
    team.resume_process("robot_0")
    wait_for_x(team, stood + 0.1)
    wait_for_text(team, "obstacle ahead")
    wait_for_stand(team)
    assert WALL - 0.6 < x_of(team) < WALL - 0.3
    assert bases == ["cart"]
    assert not [line for line in team.lines("robot_0") if "no robot_0/base_info" in line]
    base.terminate()
    assert base.communicate(timeout=LIMIT) == ("", None)
    assert base.returncode == 0


def test_a_base_that_does_not_say_where_its_laser_is_never_drives(team: TeamFixture, tmp_path: Path) -> None:
    """Its robot gets no GO and names the frame, as `zteam doctor` does with the way out; tilted, it names the angle.
    When somebody says where a level laser is, it drives; when that frame is lost, it stands."""
    code = block("python", "base_0.py")
    silent = code.replace(', transform("base_link", "base_laser_link", z=0.2)', "")
    assert silent != code
    (tmp_path / "base_0.py").write_text(silent)
    (tmp_path / "real.toml").write_text(block("toml", "real.toml"))
    fixed = team.bus.publisher("robot_0/tf_static", TFMessage, latched=True)
    with subprocess.Popen([sys.executable, tmp_path / "base_0.py"], env={**os.environ, **team.environment}) as process:
        try:
            team.launch(tmp_path / "real.toml")
            lacks = "its laser's frame robot_0/base_laser_link (robot_0/tf_static, from its base)"
            wait_for_text(team, f"waiting for {lacks}")
            done = team.command("doctor", "--json")
            found = {row["what"]: row for row in json.loads(done.stdout) if not row["good"]}
            assert done.returncode == 1
            assert lacks in found["lasers"]["text"]
            assert lacks in found["robots"]["text"]
            way_out = "have its base publish robot_0/base_footprint -> robot_0/base_laser_link on robot_0/tf_static"
            assert found["lasers"]["next_step"].startswith(way_out)
            tilted = "a level laser (robot_0/base_laser_link is tilted by 29°, 10° is the most)"
            for parent, tilt, text in (
                ("base_link", 0.5, f"waiting for {tilted}"),
                ("base_link", 0.0, ""),
                ("nowhere", 0.0, f"needs {lacks}"),
            ):
                at = Transform(rotation=Quaternion(*quaternion_from_rpy(tilt, 0.0, 0.0)))
                fixed.put(TFMessage([TransformStamped(Header(frame_id=parent), "base_laser_link", at)]))
                wait_for_text(team, text)
                if text:
                    wait_for_stand(team)
                    assert (x_of(team) > 0.0) == (parent == "nowhere")
                else:
                    wait_for_x(team, 0.05)
        finally:
            process.kill()

"""`world = "none"`: a team without a simulator, with the team file and the base driver of docs/real-robots.md."""

import json
import os
import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.limits import LIMIT
from zteam.clock import wait_until
from zteam.geometry import quaternion_from_rpy
from zteam.messages import (
    BaseInfo,
    Header,
    Odometry,
    Quaternion,
    RobotStatus,
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


class Watched:
    """What a real team tells: the newest message of each kind."""

    def __init__(self, team: TeamFixture) -> None:
        self.changed = threading.Condition()
        self.odom = Odometry()
        self.status = RobotStatus()
        self.bases: list[str] = []
        for key, kind in (("odom", Odometry), ("status", RobotStatus), ("base_info", BaseInfo)):
            team.bus.subscribe(f"robot_0/{key}", kind, self._take, latched=kind is BaseInfo)

    def _take(self, _key: str, message: Odometry | RobotStatus | BaseInfo) -> None:
        with self.changed:
            if isinstance(message, Odometry):
                self.odom = message
            elif isinstance(message, RobotStatus):
                self.status = message
            else:
                self.bases.append(message.model)
            self.changed.notify_all()

    @property
    def x(self) -> float:
        """Metres from the start, by the base's own odometry."""
        return self.odom.pose.pose.position.x

    @property
    def speed(self) -> float:
        """m/s, by the base's own odometry."""
        return self.odom.twist.twist.linear.x

    def wait_for_x(self, x: float) -> None:
        """Wait until the robot is so far."""
        with self.changed:
            assert wait_until(self.changed, lambda: self.x > x, LIMIT), (self.x, self.status)

    def wait_for_text(self, text: str) -> None:
        """Wait until the robot's status says this."""
        with self.changed:
            assert wait_until(self.changed, lambda: self.status.text == text, LIMIT), self.status

    def wait_for_stand(self) -> None:
        """Wait until the wheels stand."""
        with self.changed:
            assert wait_until(self.changed, lambda: self.speed == 0.0, LIMIT), self.x


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
    watched = Watched(team)
    team.launch(tmp_path / "real.toml")
    watched.wait_for_x(0.05)
    team.pause_process("robot_0")
    watched.wait_for_stand()
    # The watchdog, and not the wall.
    stood = watched.x
    assert stood < WALL - 0.6
    team.resume_process("robot_0")
    watched.wait_for_x(stood + 0.1)
    watched.wait_for_text("obstacle ahead")
    watched.wait_for_stand()
    assert WALL - 0.6 < watched.x < WALL - 0.3
    assert watched.bases == ["cart"]
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
    watched = Watched(team)
    fixed = team.bus.publisher("robot_0/tf_static", TFMessage, latched=True)
    with subprocess.Popen([sys.executable, tmp_path / "base_0.py"], env={**os.environ, **team.environment}) as process:
        try:
            team.launch(tmp_path / "real.toml")
            lacks = "its laser's frame robot_0/base_laser_link (robot_0/tf_static, from its base)"
            watched.wait_for_text(f"waiting for {lacks}")
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
                watched.wait_for_text(text)
                if text:
                    watched.wait_for_stand()
                    assert (watched.x > 0.0) == (parent == "nowhere")
                else:
                    watched.wait_for_x(0.05)
        finally:
            process.kill()

"""Teams in which each process has a certificate of its own."""

import json
import os
import subprocess
from contextlib import closing
from pathlib import Path

import pytest

from support.limits import LIMIT
from support.web_view import open_page, open_view
from zteam import names
from zteam.bus import BusOptions, connect
from zteam.bus.options import TlsFiles
from zteam.clock import HOST_FACTOR, monotonic
from zteam.errors import BusError
from zteam.messages import PoseStamped, Twist
from zteam.node.kinds import ROUTER
from zteam.robot.client import start_robot
from zteam.team.launch.process import zteam_command
from zteam.team.security.certificates import files_of
from zteam.team.testing.team import TeamFixture

pytestmark = [pytest.mark.team, pytest.mark.gate]

TEAM = """
[team]
world = "arena"

[[robots]]
id = 0
behavior = "wander"

[[robots]]
id = 1
behavior = "wander"

[security.grants]
operator = ["simulation"]
"""


@pytest.fixture
def team_file(tmp_path: Path) -> Path:
    """Two robots that wander; people's tools may pause the world."""
    path = tmp_path / "pair.toml"
    path.write_text(TEAM)
    return path


def zteam(*words: str, environment: dict[str, str], cwd: Path) -> "subprocess.CompletedProcess[str]":
    """Run a command to its end."""
    return subprocess.run(
        zteam_command("zteam", *words),
        env={**os.environ, **environment},
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
        stdin=subprocess.DEVNULL,
    )


def test_tools_are_let_in_with_the_certificate_that_up_prints(team_file: Path, tmp_path: Path) -> None:
    """The doctor finds no problem, and the simulator obeys; a tool without a certificate is told what is missing; one
    without the grant is told that it may not start processes."""
    launcher = subprocess.Popen(
        zteam_command("zteam", "up", str(team_file), "--secure", "my certs"),
        cwd=tmp_path, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    try:
        assert launcher.stdout is not None
        told, go = "", False
        for line in launcher.stdout:
            told = line.partition("export ")[2].strip() or told
            go = go or "All robots GO!" in line
            if told and go:
                break
        # As a shell reads it.
        shown = subprocess.run(["bash", "-c", f"export {told}; env -0"], capture_output=True, text=True, check=True)
        environment = dict(pair.split("=", 1) for pair in shown.stdout.split("\0") if pair.startswith("ZTEAM_"))
        endpoint = environment.setdefault("ZTEAM_CONNECT", "tls/127.0.0.1:7447")
        done = zteam("doctor", "--json", environment=environment, cwd=tmp_path)
        found = {row["what"]: row for row in json.loads(done.stdout)}
        assert done.returncode == 0, found
        assert found["certificate"]["text"].startswith("operator.1, valid for ")
        assert zteam("sim", "pause", environment=environment, cwd=tmp_path).returncode == 0
        files = TlsFiles(*(environment[f"ZTEAM_TLS_{part}"] for part in ("CA", "CERT", "KEY")))
        refused = pytest.raises(BusError, match="this process's certificate may not ask for it")
        with closing(connect(BusOptions(endpoint, tls=files), patience=LIMIT)) as bus, refused:
            start_robot(bus, 1, "wander")
        outside = zteam("node", "list", "--connect", endpoint.replace("tls/", "tcp/"), environment={}, cwd=tmp_path)
        assert outside.returncode == 1
        assert "takes certificates only" in outside.stderr
    finally:
        launcher.terminate()
        launcher.communicate(timeout=LIMIT)
    assert launcher.returncode == 0


OUT = 2.0 * HOST_FACTOR
"""Host seconds from the start of `zteam certs revoke` until nothing of the process is heard."""


@pytest.mark.real_time
def test_a_revoked_robot_is_out(team: TeamFixture, team_file: Path, tmp_path: Path) -> None:
    """Within 2 s, the best of three, it is not heard, then its wheels stand, while the other drives on; its next
    certificate lets it in again."""
    heard: list[float] = []
    """Host times of its commands."""

    def certs(verb: str) -> None:
        done = zteam("certs", verb, "robot_1", environment={}, cwd=tmp_path)
        assert done.returncode == 0, done.stderr

    def revoke() -> float:
        """The seconds until its last command."""
        team.until(lambda: team.robot(1).speed > 0.1, within=LIMIT)
        begin = monotonic()
        certs("revoke")
        team.wait_for_line(ROUTER, "the router has taken it")
        team.until(lambda: not team.alive("robot_1") and team.alive("robot_0"), within=LIMIT)
        # Many times what the watchdog and the brakes take.
        team.run(1.0)
        last, place, other = heard[-1], team.robot(1).pose, team.robot(0).pose
        team.until(lambda: team.robot(0).pose != other, within=LIMIT)
        team.run(0.5)
        assert (heard[-1], team.robot(1).pose) == (last, place)
        certs("issue")
        team.restart("robot_1")
        team.until(lambda: team.robot(1).pose != place, within=LIMIT)
        return last - begin

    team.launch(team_file, lockstep=False, secure=tmp_path / "certs")
    team.bus.subscribe(names.robot_key(1, names.CMD_VEL), Twist, lambda _key, _command: heard.append(monotonic()))
    team.wait_for_go()
    team.expect_end("robot_1")
    took = [revoke()]
    while took[-1] >= OUT and len(took) < 3:
        took.append(revoke())
    assert min(took) < OUT, took


GOALS = """
[team]
world = "arena"

[[robots]]
id = 0
behavior = "go_to"

[security.grants]
"""
GRANTS = 'view = ["goals", "teleop"]\noperator = ["goals", "teleop"]\n'


@pytest.mark.parametrize("granted", [True, False], ids=["granted", "not granted"])
def test_a_command_that_the_router_drops_is_refused(team: TeamFixture, tmp_path: Path, granted: bool) -> None:
    """The page and the commands say that the certificate may not, and the page notes no goal; with the grants they are
    obeyed."""
    (tmp_path / "team.toml").write_text(GOALS + GRANTS * granted)
    # The fixture makes certificates of the processes that it starts; this view is the test's.
    assert zteam("certs", "init", "team.toml", environment={}, cwd=tmp_path).returncode == 0
    team.launch(tmp_path / "team.toml", lockstep=False, secure=tmp_path / "certs")
    team.wait_for_go()
    heard: list[PoseStamped] = []
    team.bus.subscribe(names.robot_key(0, names.GOAL_POSE), PoseStamped, lambda _key, goal: heard.append(goal))
    place = team.robot(0).pose
    options = BusOptions(team.endpoint, team.namespace, tls=files_of(tmp_path / "certs", names.VIEW))
    with (
        closing(connect(options, patience=LIMIT)) as bus,
        open_view(bus) as view,
        open_page(view.port) as page,
    ):
        page.say(op="look", layers=["goals"])
        page.wait(lambda: page.docs.get("goals") == [] and view.state.poses)
        told = [page.command(op="goal", robots=[0], x=place.x + 0.8, y=place.y, yaw=0.0)]
        if granted:
            page.wait(lambda: [row["state"] for row in page.docs["goals"]] == ["succeeded"])
        else:
            assert view.state.received.get(names.robot_key(0, names.GOAL_POSE)) is None
        told += [
            page.command(op="take", robot=0),
            page.command(op="initialpose", robot=0, x=place.x, y=place.y, yaw=0.0),
        ]
    (tmp_path / "goals.yaml").write_text(f"- {{robot: 0, x: {place.x}, y: {place.y}}}")
    commands = (
        ["goto", "0", str(place.x), str(place.y)],
        ["teleop", "--id", "0", "--script", "i*2"],
        ["goals", str(tmp_path / "goals.yaml")],
        ["topic", "pub", "robot_0/cmd_vel_teleop", "geometry_msgs/msg/Twist", "--times", "3"],
    )
    for words in commands:
        done = team.command(*words, timeout=LIMIT)
        assert (done.returncode == 0) == granted, done.stderr
        told.append(done.stderr)
    assert bool(heard) == granted
    topics = "goal_pose", "cmd_vel_teleop", "initialpose", "goal_pose", "cmd_vel_teleop", "goal_pose", "cmd_vel_teleop"
    for topic, text in zip(topics, told, strict=True):
        line = f"the router drops robot_0/{topic}: this process's certificate may not publish it"
        assert (line in text) != granted, told

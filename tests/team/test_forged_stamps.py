"""Messages whose Zenoh time stamp has another session's id, and times of other clocks: they silence nobody for good.

In a secure team the sender has the certificate of a robot, and writes on that robot's own keys alone.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest
import zenoh

from zteam import names
from zteam.bus.options import BusOptions, client_config
from zteam.clock import NS_PER_S, wall_ns
from zteam.messages import (
    Clock,
    Done,
    Header,
    LaserScan,
    Log,
    Message,
    Odometry,
    Quaternion,
    RobotStatus,
    TeamStatus,
    TFMessage,
    Tick,
    Time,
    Transform,
    TransformStamped,
    Twist,
    TwistStamped,
    Vector3,
    encode,
)
from zteam.messages.message import encoding_of
from zteam.team.security.certificates import files_of
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

TEAM = """
[team]
world = "arena"
[[robots]]
ids = "0-1"
behavior = "wander"
"""
AHEAD = (3600, 1, 0, -1, -3600, 2**31)
"""Seconds from now to the forged stamps."""
FAR = Time(2**31 - 1)
"""In headers."""
OWN = ("cmd_vel", "status", "log", "done")
"""What the certificate of a robot may write."""


def forged_messages(robot_id: int) -> dict[str, Message]:
    """What the processes of a team take, on each key: far in the future where a message has a time of its own."""
    header = Header(FAR, names.MAP_FRAME)
    own = names.robot_name(robot_id)
    frames = [(f"{own}/odom", f"{own}/base_footprint"), (names.MAP_FRAME, f"{own}/odom"), (f"{own}/odom", f"{own}/tag")]
    moved = TFMessage([TransformStamped(Header(FAR, parent), child, Transform()) for parent, child in frames])
    topics: dict[str, Message] = {
        names.CMD_VEL: Twist(),
        names.CMD_VEL_TELEOP: Twist(),
        names.CMD_VEL_NAV: TwistStamped(header),
        names.BASE_SCAN: LaserScan(header),
        names.ODOM: Odometry(header),
        names.STATUS: RobotStatus(header, robot_id),
        names.TF: moved,
        names.LOG: Log(FAR),
        names.DONE: Done(),
    }
    team = {names.CLOCK: Clock(FAR), names.TF: moved, names.TICK: Tick(FAR, 1, 2**40)}
    return {**{f"{own}/{topic}": message for topic, message in topics.items()}, **team}


def sessions(attacker: zenoh.Session) -> list[str]:
    """The ids of all sessions of the team."""
    tokens = [str(reply.ok.key_expr) for reply in attacker.liveliness().get(names.tokens_key("*")) if reply.ok]
    return sorted({token[1] for token in map(names.split_token_key, tokens) if token is not None})


def stamp(session: str, ahead: int) -> zenoh.Timestamp:
    """A time stamp of that session, so many seconds ahead."""
    seconds = min(wall_ns() // NS_PER_S + ahead, 2**32 - 1)
    return zenoh.Timestamp(zenoh.NTP64(seconds, 0), zenoh.TimestampId(bytes.fromhex(session.zfill(32))[::-1]))


def forge(attacker: zenoh.Session, keys: Sequence[str], team: Sequence[str]) -> None:
    """On each key a message of one byte and a valid one, with the id of each session of the team and all times."""
    known = {key: message for robot_id in (0, 1) for key, message in forged_messages(robot_id).items()}
    for session in team:
        for ahead in AHEAD:
            for key in keys:
                attacker.put(key, b"\0", timestamp=stamp(session, ahead))
                if key in known:
                    message = known[key]
                    told = encoding_of(type(message))
                    attacker.put(key, encode(message), encoding=told, timestamp=stamp(session, ahead))


@contextmanager
def attacking(team: TeamFixture, certificates: Path | None) -> Iterator[zenoh.Session]:
    """A plain client; in a secure team it has the certificate of robot 1."""
    tls = None if certificates is None else files_of(certificates, "robot_1")
    with zenoh.open(client_config(BusOptions(connect=team.endpoint, namespace=team.namespace, tls=tls))) as attacker:
        team.wait_for(lambda: len(sessions(attacker)) >= 5)
        yield attacker


def drive_on(team: TeamFixture) -> None:
    """Both robots drive 30 cm within 15 simulated seconds."""
    goals = {i: team.robot(i).distance_travelled + 0.3 for i in (0, 1)}
    team.until(lambda: all(team.robot(i).distance_travelled > goal for i, goal in goals.items()), within=15.0)


@pytest.mark.parametrize("lockstep", [pytest.param(False, marks=pytest.mark.real_time), True])
@pytest.mark.parametrize("secure", [False, True], ids=["plain", "secure"])
def test_no_time_stamp_silences_a_robot_for_good(
    team: TeamFixture, tmp_path: Path, secure: bool, lockstep: bool
) -> None:
    """Stamps of all sessions of the team, an hour ahead and of other times, on a robot's own keys in a secure team, on
    all keys in a plain one: afterwards both robots drive on. In a secure team no command of robot 0 was dropped."""
    (tmp_path / "team.toml").write_text(TEAM)
    certificates = tmp_path / "certs" if secure else None
    team.launch(tmp_path / "team.toml", secure=certificates, lockstep=lockstep)
    team.wait_for_go()
    drive_on(team)
    with attacking(team, certificates) as attacker:
        keys = [names.robot_key(1, topic) for topic in OWN]
        if not secure:
            keys = [key for robot_id in (0, 1) for key in forged_messages(robot_id)]
        forge(attacker, keys, sessions(attacker))
        if lockstep:
            team.run(0.5)
        drive_on(team)
        forge(attacker, keys, sessions(attacker))
    drive_on(team)
    if secure and not lockstep:
        assert not [line for line in team.lines(names.SIMULATOR) if "dropped a message on robot_0/cmd_vel" in line]


def test_no_time_stamp_hides_later_latched_messages(team: TeamFixture, tmp_path: Path) -> None:
    """In a plain team a forged message on a latched key counts, with the id of the true writer and an hour ahead. What
    that writer says later counts again: the monitor's state of the team, and where the simulator puts a robot."""
    (tmp_path / "team.toml").write_text(TEAM)
    team.launch(tmp_path / "team.toml")
    team.wait_for_go()
    lost: list[list[int]] = []
    starts: list[float] = []

    def take_static(_key: str, message: TFMessage) -> None:
        starts.extend(t.transform.translation.x for t in message.transforms if t.child_frame_id == "robot_0/odom")

    team.bus.subscribe(names.TEAM_STATUS, TeamStatus, lambda _, status: lost.append(status.lost.tolist()), latched=True)
    team.bus.subscribe(names.TF_STATIC, TFMessage, take_static, latched=True)
    odom = TransformStamped(Header(Time(), names.MAP_FRAME), "robot_0/odom", Transform(Vector3(9.0), Quaternion(w=1.0)))
    with attacking(team, None) as attacker:
        for key, message in {names.TEAM_STATUS: TeamStatus(), "robot_0/tf_static": TFMessage([odom])}.items():
            for session in sessions(attacker):
                told = encoding_of(type(message))
                attacker.put(key, encode(message), encoding=told, timestamp=stamp(session, 3600))
        team.wait_for(lambda: starts[-1:] == [9.0])
    team.sim.move(0, 1.0, -1.0, 0.0)
    team.run(0.2)
    team.wait_for(lambda: starts[-1] != 9.0)
    team.kill("robot_1")
    team.wait_for(lambda: lost[-1:] == [[1]])

"""Attacks on a team with certificates: a router with the access control of a team file, and a session of each kind.

Zenoh drops what is not allowed without a word. So after each attack the attacker sends something that it may send, on
the same link: when that has arrived, the attack would have arrived too.
"""

import itertools
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import msgspec
import pytest
import zenoh

from support.limits import LIMIT
from support.transports import RouterProcess, wait_until_true
from zteam import names
from zteam.bus import Bus, BusOptions, Change, NoRequest, connect, connection
from zteam.bus.options import client_config
from zteam.bus.presence import Claim
from zteam.bus.transport import Declaration
from zteam.errors import BusError
from zteam.messages import (
    Twist,
)
from zteam.team.file.reading import read_team_tables
from zteam.team.security.access import rights_of
from zteam.team.security.certificates import ACCESS, files_of, open_authority

TEAM = {
    "team": {"world": "arena"},
    "robots": [{"id": 0}, {"id": 1, "navigation": True}],
    "nodes": [{"name": "near", "command": ["near"]}],
    "security": {"grants": {"operator": ["teleop"], "guide": ["goals"], "teacher": ["simulation", "parameters"]}},
}
FORGED = b"forged"
MONITOR = "monitor"
"""It hears everything."""
REVOKED = "revoked"
"""A certificate of robot 1 that was taken back."""


class Secured:
    """The router, and a session for each certificate."""

    def __init__(self, folder: Path, namespace: str, ends: ExitStack) -> None:
        rights = rights_of(read_team_tables("team", TEAM).team)
        with open_authority(folder, make=True) as authority:
            authority.make()
            authority.take_team("team", rights, namespace)
            authority.issue(["robot_1"])
            for ending in ("pem", "key"):
                (folder / f"robot_1.{ending}").rename(folder / f"{REVOKED}.{ending}")
            authority.revoke("robot_1")
            authority.issue(list(rights))
        self._folder = folder
        router = RouterProcess("tls/127.0.0.1:0", "--config", str(folder / ACCESS), tls=files_of(folder, "router"))
        ends.callback(router.kill)
        self._endpoint, self._namespace, self._ends = router.endpoint, namespace, ends
        self._sessions: dict[str, zenoh.Session] = {}
        self._numbers = itertools.count()
        self.heard: list[tuple[str, bytes]] = []
        """(key, payload) of all that the monitor hears; a deletion has the payload FORGED."""
        self.session(MONITOR).declare_subscriber("**", self._hear)

    def _hear(self, sample: zenoh.Sample) -> None:
        deleted = sample.kind == zenoh.SampleKind.DELETE
        self.heard.append((str(sample.key_expr), FORGED if deleted else sample.payload.to_bytes()))

    def options(self, name: str) -> BusOptions:
        """Those of the process `name`."""
        return BusOptions(
            connect=self._endpoint, namespace=self._namespace or None, tls=files_of(self._folder, name), lease=LIMIT
        )

    def open(self, name: str, *, inside: bool = True) -> zenoh.Session:
        """A session with the certificate of `name`, in the team's namespace or beside all namespaces."""
        options = self.options(name)
        session = zenoh.open(client_config(options if inside else msgspec.structs.replace(options, namespace=None)))
        self._ends.callback(session.close)
        return session

    def session(self, name: str) -> zenoh.Session:
        """The one session of `name`."""
        if name not in self._sessions:
            self._sessions[name] = self.open(name)
            if name != MONITOR:
                self.hear(self._sessions[name], names.log_key(name))
        return self._sessions[name]

    def bus(self, name: str) -> Bus:
        """A further session of `name`, as a process opens it."""
        bus = connect(self.options(name), patience=LIMIT)
        self._ends.callback(bus.close)
        return bus

    def hear(self, session: zenoh.Session, key: str) -> None:
        """Send something on a key, and wait until the monitor has heard it."""
        payload = str(next(self._numbers)).encode()
        found = key, payload
        # The first may come before the router knows of the subscriber.
        wait_until_true(lambda: session.put(key, payload) is None and found in self.heard)

    def forged(self, name: str, session: zenoh.Session) -> list[str]:
        """The keys of what the monitor has heard of an attack by the process `name`."""
        prefix = f"{self._namespace}/" if self._namespace and session is not self.session(name) else ""
        payload = str(next(self._numbers)).encode()
        session.put(f"{prefix}{name}/log", payload)
        wait_until_true(lambda: (f"{name}/log", payload) in self.heard)
        return [key for key, told in self.heard if told == FORGED]


@pytest.fixture(scope="module")
def secured_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Secured]:
    """In a namespace."""
    with ExitStack() as ends:
        yield Secured(tmp_path_factory.mktemp("security"), "red", ends)


@pytest.fixture
def secured(secured_once: Secured) -> Secured:
    """Nothing has been heard yet."""
    secured_once.heard.clear()
    return secured_once


PUTS = [
    ("robot_0", "robot_0/cmd_vel", ("robot_1", "near", "operator", "view", "nav_1", "tf", "up")),
    ("robot_0", "robot_0/done", ("robot_1", "near", "operator")),
    ("robot_0", "robot_0/status", ("robot_1", "sim", "near")),
    ("robot_0", "robot_0/log", ("robot_1", "sim")),
    ("sim", "sim/tick", ("robot_1", "near", "tf", "up", "operator")),
    ("sim", "clock", ("robot_1", "tf", "up")),
    ("sim", "map", ("robot_1", "nav_1", "near")),
    ("sim", "robot_1/base_scan", ("robot_1", "nav_1", "near")),
    ("sim", "robot_1/odom", ("robot_1", "nav_1")),
    ("sim", "robot_1/tf", ("robot_1", "near", "tf")),
    ("nav_1", "robot_1/tf", ("robot_0",)),
    ("sim", "robot_0/tf", ("nav_1", "robot_0")),
    ("sim", "robot_0/tf_static", ("robot_0", "nav_1", "tf")),
    ("sim", "robot_12/base_scan_3", ("robot_1",)),
    ("tf", "tf", ("robot_1", "sim", "near", "nav_1")),
    ("tf", "tf_static", ("robot_1", "sim", "near")),
    ("operator", "robot_0/cmd_vel_teleop", ("robot_1", "robot_0", "view", "guide", "near")),
    ("guide", "robot_1/goal_pose", ("robot_0", "robot_1", "view", "operator", "near")),
    ("guide", "robot_1/initialpose", ("view", "operator")),
    ("nav_1", "robot_1/cmd_vel_nav", ("robot_1", "robot_0", "operator")),
    ("near", "near/distance", ("robot_0", "operator")),
]
"""The writer of a key, the key, and processes that may not write it."""


def test_no_other_process_writes_a_key(secured: Secured) -> None:
    """What others put on it, or delete, reaches no process; what its writer puts does."""
    for writer, key, attackers in PUTS:
        for attacker in attackers:
            session = secured.session(attacker)
            session.put(key, FORGED)
            session.delete(key)
            assert secured.forged(attacker, session) == []
        secured.hear(secured.session(writer), key)


WILDCARDS = ("**", "*/*", "*/cmd_vel", "robot_$*/cmd_vel", "robot_0/*", "robot_1/*", "robot_1/**", "*/done")
FROM_BESIDE = ("**", "*/robot_0/cmd_vel", "*/*/cmd_vel", "re$*/robot_0/cmd_vel", "red/**", "red/robot_0/cmd_vel")


def test_nothing_is_written_by_a_wildcard(secured: Secured) -> None:
    """Not even by one that has the writer's own keys only; nor by a session beside all namespaces."""
    attacker = "robot_1"
    session, beside = secured.session(attacker), secured.open(attacker, inside=False)
    for sender, keys in ((session, WILDCARDS), (beside, FROM_BESIDE)):
        assert secured.forged(attacker, sender) == []
        for key in keys:
            sender.put(key, FORGED)
            sender.delete(key)
        assert secured.forged(attacker, sender) == []
    secured.hear(session, names.log_key(attacker))


def test_a_change_is_asked_for_by_a_grant_only(secured: Secured) -> None:
    """Neither by the key nor by a wildcard; questions that change nothing are answered."""
    simulator, robot, changed = secured.bus("sim"), secured.bus("robot_0"), list[str]()
    asked = {"sim/pause": simulator, "sim/reset": simulator, "robot_0/set_parameters": robot}
    for key, bus in asked.items():
        bus.serve(key, Change, lambda _, key=key: changed.append(key))
    simulator.serve("sim/status", NoRequest, lambda _: "running")
    beside = secured.open("operator", inside=False)
    for name in ("operator", "robot_1", "near", "guide", "view"):
        bus = secured.bus(name)
        wait_until_true(lambda bus=bus: bool(bus.query("sim/status", str)))
        for key in asked:
            with pytest.raises(BusError, match="this process's certificate may not ask for it"):
                bus.query(key, list, Change())
        # These reach the simulator, and it refuses them.
        for wildcard in ("sim/*", "**", "sim/pau$*", "robot_$*/set_parameters"):
            bus.transport.get(wildcard, b"{}", LIMIT)
    for place in ("*/sim/pause", "**/sim/pause", "*/pause", "**"):
        list(beside.get(place, timeout=LIMIT))
    assert changed == []
    teacher = secured.bus("teacher")
    for key in asked:
        wait_until_true(lambda key=key: bool(teacher.query(key, None, Change())))
    assert changed == list(asked)
    simulator.close()
    robot.close()


FORGED_ANSWERS = ("tf/lookup", "robot_0/info", "sim/status", "robot_1/navigation/cancel", "**")


def test_no_other_process_answers_a_query(secured: Secured) -> None:
    """A forged answer to a look-up of transforms, or to a question for robot 0, does not come."""
    near, operator = secured.session("near"), secured.bus("operator")

    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(query.key_expr, FORGED)

    # The last one on the same link: where it answers, the others would.
    serving = [near.declare_queryable(key, answer, complete=True) for key in (*FORGED_ANSWERS, "near/info")]
    secured.bus("tf").serve("tf/lookup", NoRequest, lambda _: "frames")
    wait_until_true(lambda: bool(operator.transport.get("near/info", b"", LIMIT)))
    wait_until_true(lambda: operator.query("tf/lookup", str) == [("tf/lookup", "frames")])
    assert [operator.query(key, str) for key in FORGED_ANSWERS[1:4]] == [[], [], []]
    for entity in serving:
        entity.undeclare()


FORGED_TOKENS = ("robot_0/alive/x", "robot_0/claim/00000000000000000000-x", "sim/alive/x", "robot_$*/alive/x", "**")


def test_no_other_process_holds_a_token(secured: Secured) -> None:
    """A forged presence or claim is not seen; so no process can keep robot 0 from its name."""
    holder, watcher = secured.session("robot_1"), secured.session(MONITOR)
    tokens = [holder.liveliness().declare_token(key) for key in (*FORGED_TOKENS, "robot_1/alive/x")]

    def seen() -> list[str]:
        return [str(reply.ok.key_expr) for reply in watcher.liveliness().get("*/*/*", timeout=LIMIT) if reply.ok]

    wait_until_true(lambda: "robot_1/alive/x" in seen())
    assert [key for key in seen() if key.endswith("x")] == ["robot_1/alive/x"]
    bus = secured.bus("robot_0")
    claim = Claim(bus, "robot_0")
    claim.win(lambda _: None)
    wait_until_true(lambda: names.token_key("robot_0", bus.instance) in seen())
    claim.release()
    for token in tokens:
        token.undeclare()


def test_a_process_learns_that_its_certificate_has_another_name(secured: Secured) -> None:
    """It says so, and gives up, where the router would drop all that it sends."""
    bus = secured.bus("robot_1")
    with pytest.raises(BusError, match="does not let this process be robot_0: its certificate has another name"):
        Claim(bus, "robot_0").win(lambda _: None)


def test_what_the_router_drops_is_reported_to_its_sender(secured: Secured, caplog: pytest.LogCaptureFixture) -> None:
    """Each key and each query once, and the keys to those that ask for declarations; nothing of what it may send."""
    near, operator, robot = secured.bus("near"), secured.bus("operator"), secured.bus("robot_0")
    for _ in range(2):
        for key in ("robot_0/cmd_vel", "near/cmd_vel"):
            near.publisher(key, Twist)
        for key in ("robot_0/set", "near/set"):
            near.serve(key, NoRequest, lambda _: 1)
    robot.publisher("robot_0/cmd_vel", Twist)
    robot.serve("robot_0/set_parameters", NoRequest, lambda _: 1)
    dropped = Declaration("robot_0/cmd_vel", near.instance, True, dropped=True)
    wait_until_true(lambda: {each for each in operator.declarations() if each.dropped} == {dropped})
    # The last look ends with its session.
    near.close()
    robot.close()
    way_out = "'zteam certs explain near' lists what it may"
    assert [line for line in caplog.messages if line.endswith(way_out) or "explain robot_0" in line] == [
        f"the router drops robot_0/cmd_vel: this process's certificate may not publish it: {way_out}",
        f"the router hides the query robot_0/set: this process's certificate may not answer it: {way_out}",
    ]


def test_a_certificate_without_rights_is_told(secured: Secured, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that was taken back hears and writes nothing; the next one of the same name does."""
    monkeypatch.setattr(connection, "_RIGHTS_WITHIN", 0.1)
    with pytest.raises(BusError, match=r"gives the certificate robot_1\.1 no rights: it was revoked or replaced"):
        connect(secured.options(REVOKED), patience=0.0)
    session = secured.open(REVOKED)
    session.put("robot_1/cmd_vel", FORGED)
    assert list(session.liveliness().get("**", timeout=LIMIT)) == []
    assert list(session.get("**", timeout=LIMIT)) == []
    secured.hear(secured.session("robot_1"), "robot_1/cmd_vel")
    assert FORGED not in {payload for _, payload in secured.heard}


def test_of_the_router_a_member_reads_its_own_record_only(secured: Secured) -> None:
    """Questions to its admin space that list sessions and subscribers, and may stop it, are dropped."""
    beside = secured.open("operator", inside=False)

    def answers(key: str) -> list[str]:
        keys = [str(reply.ok.key_expr) for reply in beside.get(key, timeout=LIMIT) if reply.ok]
        # A session tells itself of itself.
        return [key for key in keys if not key.startswith(f"@/{beside.zid()}/")]

    wait_until_true(lambda: len(answers("@/*/router")) == 1)
    for key in ("@/*/router/subscriber/**", "@/*/router/**", "@/*/*/**", "@/**"):
        assert answers(key) == [], key

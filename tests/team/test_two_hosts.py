"""A team on two hosts whose routers are linked: network namespaces, which need root."""

import json
import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

import zteam
from support.clock_offset import build_clock
from support.hosts import Hosts, Started, why_no_hosts
from support.pages import DOCS, find_file

PAGE = DOCS / "deploy.md"
REMOTE = """#!/bin/sh
# Copies for the page: `ssh HOST COMMAND` works in the folder of host-b, and `scp FILE… HOST:FOLDER` copies there.
case "$0" in
*/ssh) shift && cd "$FAR" && exec "$@" ;;
*/scp) for last; do :; done; exec cp $(printf '%s\\n' "$@" | sed '$d') "$FAR/${last#*:}" ;;
esac
"""
_WITHOUT_ROOT = why_no_hosts() if os.geteuid() == 0 else "network namespaces need root"
pytestmark = pytest.mark.skipif(bool(_WITHOUT_ROOT), reason=_WITHOUT_ROOT)


@pytest.fixture
def make_hosts(tmp_path: Path) -> Iterator[Callable[[float], Hosts]]:
    """Two hosts; the clock of host-b is so many seconds ahead."""
    clock = build_clock(tmp_path)
    with ExitStack() as stack:
        yield lambda offset: stack.enter_context(Hosts(tmp_path, clock, offset))


def run_block(hosts: Hosts, host: str, name: str) -> Started:
    """Start a block of the page on a host, in a terminal of its own."""
    block = find_file(name, PAGE).save(hosts.folders[host])
    return hosts.start(host, "sh", "-e", str(block), FAR=str(hosts.folders["b"]))


def make_certificates(hosts: Hosts, folder: Path) -> None:
    """As the page does; `folder` is that of the hosts."""
    (folder / "bin").mkdir()
    for command in ("ssh", "scp"):
        (folder / "bin" / command).write_text(REMOTE)
        (folder / "bin" / command).chmod(0o755)
    certificates = run_block(hosts, "a", "certificates.sh")
    assert certificates.finish() == 0, certificates.lines


def test_a_robot_follows_a_leader_on_another_host(make_hosts: Callable[[float], Hosts], tmp_path: Path) -> None:
    """The page's commands: mutual TLS between the routers, clocks that differ by a second, and a link that is cut until
    both sides have lost each other. The robot drives, stands, and drives again."""
    hosts = make_hosts(1.0)
    make_certificates(hosts, tmp_path)
    run_block(hosts, "b", "router_b.sh")
    run_block(hosts, "a", "router_a.sh")
    team = run_block(hosts, "a", "team_a.sh")
    robot = run_block(hosts, "b", "robot_b.sh")
    robot.wait_for(lambda line: "GO: driving" in line)
    operator = {
        f"ZTEAM_TLS_{name}": f"certs/{file}"
        for name, file in (("CA", "ca.pem"), ("CERT", "operator.pem"), ("KEY", "operator.key"))
    }
    odom = hosts.start("a", "zteam", "topic", "echo", "robot_1/odom", "--json", **operator)
    drives = odom.wait_for(lambda line: _speed(line) > 0.1)
    doctor = json.loads(hosts.run("a", "zteam", "doctor", "--json", **operator)[-1])
    (clocks,) = (finding["text"] for finding in doctor if finding["what"] == "clocks")
    assert clocks.startswith("the clock of host-b is 1.0")
    hosts.connect(False)
    stands = odom.wait_for(lambda line: _speed(line) == 0.0, drives)
    lost = team.wait_for(lambda line: "robot_1 lost" in line)
    hosts.connect(True)
    team.wait_for(lambda line: "robot_1 is back" in line, lost)
    odom.wait_for(lambda line: _speed(line) > 0.1, stands)
    assert robot.process.poll() is None


def _speed(line: str) -> float:
    return float(json.loads(line)["twist"]["twist"]["linear"]["x"]) if line.startswith("{") else 0.0


def test_lockstep_across_hosts_has_the_hash_of_one_host(make_hosts: Callable[[float], Hosts], tmp_path: Path) -> None:
    """The page's commands: a participant behind the mutual TLS of two routers, whose host's clock is a second behind,
    changes no bit."""
    hosts = make_hosts(-1.0)
    make_certificates(hosts, tmp_path)
    run_block(hosts, "a", "lockstep_router_a.sh")
    run_block(hosts, "b", "lockstep_router_b.sh")
    run_block(hosts, "b", "lockstep_robot_b.sh")
    team = run_block(hosts, "a", "lockstep_team_a.sh")
    assert team.finish() == 0, team.lines
    found = json.loads((hosts.folders["a"] / "run.json").read_text())
    both = hosts.folders["a"] / "both.toml"
    both.write_text((hosts.folders["a"] / "two_hosts.toml").read_text() + "\n[[robots]]\nid = 1\nfollow = 0\n")
    alone = zteam.run_team(both, seconds=20.0)
    assert found["trajectory_sha256"] == alone.trajectory_sha256
    assert (found["external_commands"], found["hung"]) == (0, [])

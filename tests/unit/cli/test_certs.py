"""`zteam certs`: what a user makes, sees and takes back."""

import json
from pathlib import Path

import pytest

from support.commands import Run
from zteam.team.security import certificates

TEAM = """
[team]
world = "arena"

[[robots]]
id = 1
behavior = "wander"

[security.grants]
joystick = ["teleop"]
"""


@pytest.fixture(autouse=True)
def place(empty_folder: Path) -> Path:
    """A folder with a team file, in which the user stands."""
    (empty_folder / "mine.toml").write_text(TEAM)
    return empty_folder


def certs(run: Run, words: str) -> list[str]:
    """The lines of a command that succeeds."""
    return run(f"zteam certs {words}").out.splitlines()


def listed(run: Run) -> dict[tuple[str, int], str]:
    """The state of each certificate."""
    rows = json.loads(certs(run, "list --json")[0])
    return {(row["name"], row["serial"]): row["state"] for row in rows}


def test_the_life_of_a_certificate(run: Run) -> None:
    """From the authority on: issued once, renewed beside the earlier one, revoked, and issued anew."""
    made = certs(run, "init mine.toml --host 10.0.0.1 --days 30")
    assert made[0].startswith("certs/ca.pem: a new authority, valid until ")
    names = {"router", "tf", "monitor", "up", "view", "recorder", "operator", "sim", "robot_1", "joystick"}
    assert {line.partition(".pem, .key: ")[0] for line in made[1:]} == {f"certs/{name}" for name in names}
    assert listed(run) == {("authority", 0): "valid", **dict.fromkeys([(name, 1) for name in names], "valid")}
    assert certs(run, "issue robot_1") == ["robot_1.1 is valid for 29 days still"]
    _, kept = certs(run, "renew robot_1")
    assert kept.startswith("robot_1.1 stays valid until ")
    assert kept.endswith("or until 'zteam certs revoke robot_1.1'")
    (line,) = certs(run, "revoke robot_1")
    assert line.startswith("revoked: robot_1.1, robot_1.2; ")
    assert "robot_1 is revoked: 'zteam certs issue robot_1' makes the next certificate" in certs(run, "init mine.toml")
    (line,) = certs(run, "issue robot_1")
    assert line.startswith("certs/robot_1.pem, .key: robot_1.3, valid until ")
    found = listed(run)
    assert [found["robot_1", serial] for serial in (1, 2, 3)] == ["revoked", "revoked", "valid"]
    assert certs(run, "revoke robot_1.2") == ["robot_1.2 was revoked"]


def test_the_hosts_of_a_router(run: Run) -> None:
    """A certificate that lacks one is not taken for enough; the next one keeps the hosts of the last."""
    certs(run, "init mine.toml --host 10.0.0.1")
    (line,) = run("zteam certs issue router --host b", 2).err.splitlines()
    assert line.endswith("not for b: 'zteam certs renew router --host 10.0.0.1 --host b'")
    certs(run, "renew router")
    rows = json.loads(certs(run, "list --json")[0])
    hosts = {(row["name"], row["serial"]): row["hosts"] for row in rows}
    assert (hosts["router", 1], hosts["router", 2], hosts["robot_1", 1]) == (["10.0.0.1"], ["10.0.0.1"], [])


def test_a_certificate_is_explained(run: Run) -> None:
    """What it may write, answer and ask; nothing of another robot."""
    certs(run, "init mine.toml")
    first, *rows = certs(run, "explain robot_1")
    assert first == "robot_1: robot_1.1, valid"
    assert ["publishes", "robot_1/cmd_vel"] in [row.split() for row in rows]
    assert [row for row in rows if "robot_" in row and "robot_1" not in row] == [
        "changes by queries  robot_$*/stop/engage"
    ]
    assert "robot_$*/stop/release" in "".join(certs(run, "explain operator"))
    assert "cmd_vel_teleop" in "".join(certs(run, "explain joystick"))


def test_the_end_of_a_certificate_is_listed(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """The days that are left, and the state in words."""
    certs(run, "init mine.toml --days 10")
    certs(run, "renew robot_1 --days 1")
    begin = certificates.wall_ns()
    monkeypatch.setattr(certificates, "wall_ns", lambda: begin + 86_401 * 10**9)
    rows = [line.split() for line in certs(run, "list")]
    assert ["robot_1", "1", "8", "days", "expires", "soon"] in rows
    assert ["robot_1", "2", "-", "expired"] in rows
    (line,) = certs(run, "issue robot_1")
    assert "robot_1.3" in line


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        ("explain robot1", 2, "did you mean robot_1?"),
        ("revoke robot_1.4", 2, "robot_1.4: no such certificate; the last one is robot_1.1"),
        ("revoke robot_2", 2, "robot_2: no certificate of this name"),
    ],
)
def test_a_name_without_a_certificate_is_told(words: str, code: int, told: str, run: Run) -> None:
    """One line, with what there is."""
    certs(run, "init mine.toml")
    (line,) = run(f"zteam certs {words}", code).err.splitlines()
    assert told in line

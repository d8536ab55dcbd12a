"""What `zteam doctor` says about the processes of a team, kind by kind."""

import msgspec
import pytest

from zteam.bus.memory import MemoryHub
from zteam.bus.presence import Claim
from zteam.cli.doctor import Finding, check_processes, find_nodes
from zteam.launch import kinds
from zteam.launch.arguments import no_arguments
from zteam.launch.kinds import KINDS, Kind

PLANNER = Kind("planner", "planner", "zteam-planner", no_arguments, 0, "start the planner of {robots} robots")


def findings(*alive: str) -> dict[str, Finding]:
    """What doctor finds, by kind, where processes of these names are alive."""
    hub = MemoryHub()
    for name in alive:
        Claim(hub.bus(), name).win(lambda _: None)
    return {finding.what: finding for finding in check_processes(find_nodes(hub.bus()))}


@pytest.fixture
def planner(monkeypatch: pytest.MonkeyPatch) -> None:
    """A further row in the table of kinds."""
    monkeypatch.setattr(kinds, "KINDS", (*KINDS, PLANNER))


def test_every_kind_of_the_table_has_a_finding() -> None:
    """Without any process, each kind is missed with its own hint, in the order of the table."""
    assert [(f.what, f.text, f.next_step) for f in findings().values()] == [
        ("simulator", "no process sim", "zteam-sim WORLD (or real robots that publish the same keys)"),
        ("transforms", "no process tf", "zteam-tf"),
        ("monitor", "no process monitor", "zteam-monitor --team-size 1"),
        ("robots", "none", "zteam-robot --id 0"),
    ]


def test_robots_are_listed_by_number() -> None:
    """robot_10 comes after robot_2."""
    assert findings("robot_10", "robot_2")["robots"].text == "robot_2, robot_10"


def test_the_hint_of_the_monitor_has_the_size_of_the_team() -> None:
    """The user can type the hint as it is."""
    assert findings("robot_10", "robot_2")["monitor"].next_step == "zteam-monitor --team-size 2"


def test_a_missing_process_of_a_further_kind_is_told(planner: None) -> None:
    """Doctor gives the hint of the new row."""
    finding = findings()["planner"]
    assert (finding.good, finding.next_step) == (False, "start the planner of 1 robots")


def test_a_live_process_of_a_further_kind_is_good(planner: None) -> None:
    """Doctor finds the new kind by the name in its row."""
    finding = findings("planner")["planner"]
    assert (finding.good, finding.text, finding.next_step) == (True, "alive", "")


def test_a_kind_without_a_hint_is_not_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A team works without such a kind, so its absence is no problem."""
    monkeypatch.setattr(kinds, "KINDS", (*KINDS, msgspec.structs.replace(PLANNER, hint="")))
    assert "planner" not in findings()

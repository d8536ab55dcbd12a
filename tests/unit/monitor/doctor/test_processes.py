"""What is said about the processes of a team, kind by kind."""

import msgspec
import pytest

from support.team_facts import nodes, problems, robot_status, sim_status, team_facts
from zteam.messages import RobotState
from zteam.monitor.doctor.checks import check_elsewhere, check_processes, check_robots_of_world, check_team
from zteam.monitor.doctor.facts import Facts, Finding
from zteam.node import kinds
from zteam.node.kinds import KINDS, Kind

PLANNER = Kind("planner", "planner", "zteam-planner", 0, "start the planner of {robots} robots")


def findings(*alive: str) -> dict[str, Finding]:
    """What is found, by kind, where processes of these names are alive."""
    return {finding.what: finding for finding in check_processes(Facts(nodes=nodes(*alive)))}


@pytest.fixture
def planner(monkeypatch: pytest.MonkeyPatch) -> None:
    """A further row in the table of kinds."""
    monkeypatch.setattr(kinds, "KINDS", (*KINDS, PLANNER))


def test_a_team_that_works_has_no_problem() -> None:
    """Every check is good, and none of them has a note."""
    assert {finding.level for finding in check_team(team_facts())} == {"ok"}


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


def test_no_team_size_below_the_robots_of_the_world_is_advised() -> None:
    """With one process for a world of four robots, the advice is a team of four."""
    facts = Facts(nodes=nodes("robot_0", "sim", "tf"), sim=sim_status(robots=[0, 1, 2, 3]))
    assert problems(check_processes(facts)) == [("monitor", "no process monitor", "zteam-monitor --team-size 4")]


def test_a_missing_process_of_a_further_kind_is_told(planner: None) -> None:
    """The hint of the new row is given."""
    finding = findings()["planner"]
    assert (finding.good, finding.next_step) == (False, "start the planner of 1 robots")


def test_a_live_process_of_a_further_kind_is_good(planner: None) -> None:
    """The new kind is found by the name in its row."""
    finding = findings("planner")["planner"]
    assert (finding.good, finding.text, finding.next_step) == (True, "alive", "")


def test_a_kind_without_a_hint_is_not_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A team works without such a kind, so its absence is no problem."""
    monkeypatch.setattr(kinds, "KINDS", (*KINDS, msgspec.structs.replace(PLANNER, hint="")))
    assert "planner" not in findings()


def test_followers_without_an_aggregator_are_named() -> None:
    """The missing aggregator is the cause why a follower stands."""
    facts = team_facts(
        nodes=nodes("monitor", "robot_0", "robot_1", "sim"), statuses={1: robot_status(1, leader=0), 0: robot_status(0)}
    )
    text = "no process tf: robot_1 follows robot_0 and cannot without transforms"
    assert problems(check_processes(facts)) == [("transforms", text, "zteam-tf")]


def test_a_frozen_process_is_named() -> None:
    """A process with a token that does not answer is stopped or hangs."""
    facts = team_facts(nodes=nodes("monitor", "robot_0", "robot_1", "sim", "tf", silent=("robot_1",)))
    ((what, text, step),) = problems(check_processes(facts))
    assert (what, text) == ("process", "robot_1 is alive but does not answer: it is stopped (Ctrl+Z, SIGSTOP) or hangs")
    assert "kill -CONT" in step


def test_many_tokens_make_a_few_lines() -> None:
    """Any program may hold tokens: a thousand of one name are one line, and of a thousand names a few are named."""
    held = ["robot_1"] * 1000 + [f"z{number:03}" for number in range(1000)]
    facts = team_facts(nodes=nodes("monitor", "robot_0", "sim", "tf", *held, silent=tuple(held)))
    told = [finding.text for finding in check_processes(facts) if not finding.good]
    assert told[0].startswith("robot_1 is alive but does not answer (1000 sessions hold the name): ")
    assert told[-1] == "995 further processes do not answer"
    assert len(told) == 7


def test_a_robot_that_the_world_lacks_is_named() -> None:
    """The process of robot 7 in a world of two robots is told once, with the ids that the world has."""
    facts = team_facts(nodes=nodes("monitor", "robot_0", "robot_1", "robot_7", "sim", "tf"), statuses={
        0: robot_status(0), 1: robot_status(1), 7: robot_status(7, 0, text="waiting for a first scan")
    })  # fmt: skip
    ((what, text, step),) = problems(check_team(facts))
    assert what == "robots"
    assert text == "robot_7 has a process, but the world arena has no robot 7 (it has 0, 1)"
    assert step.startswith("zteam sim spawn --id 7 --pose X Y YAW")


def test_a_robot_of_the_world_without_a_process_is_a_note() -> None:
    """It may stand there on purpose, as long as the gate does not wait for it."""
    writers = {key: by for key, by in team_facts().writers.items() if not key.startswith("robot_1/cmd_vel")}
    facts = team_facts(nodes=nodes("monitor", "robot_0", "sim", "tf"), writers=writers)
    (finding,) = check_robots_of_world(facts)
    assert (finding.level, finding.text) == ("note", "no process drives robot 1 of the world")
    assert finding.next_step == "zteam-robot --id 1"


def test_a_robot_that_is_commanded_without_a_process_is_driven() -> None:
    """A script that publishes cmd_vel drives it."""
    assert not list(check_robots_of_world(team_facts(nodes=nodes("monitor", "robot_0", "sim", "tf"))))


def test_another_namespace_is_named() -> None:
    """If all processes are in other namespaces, only that is told, with the option that reaches them."""
    facts = Facts(namespace="mine", elsewhere={"lab": ["sim", "robot_1"], "": ["tf"]})
    ((what, text, step),) = problems(check_team(facts))
    assert what == "namespace"
    assert text == (
        "no process is in the namespace 'mine'; there are processes outside of namespaces: tf; "
        "in the namespace 'lab': robot_1, sim"
    )
    assert step == "--namespace '' (and unset ZTEAM_NAMESPACE)"
    (told,) = check_elsewhere(Facts(elsewhere={"lab": [f"robot_{i}" for i in range(10)]}))
    assert told.text.startswith("no process is outside of namespaces; there are processes in the namespace 'lab': ")
    assert told.text.endswith(" and 4 more")
    assert told.next_step == "--namespace lab"


def test_a_team_here_is_not_compared_with_other_namespaces() -> None:
    """Other teams on the same router are no problem."""
    assert not list(check_elsewhere(team_facts(elsewhere={"lab": ["sim"]})))


def test_another_router_of_this_machine_is_named() -> None:
    """If nothing is here, that is the problem; if part of a team is here, it is a note."""
    routers = {"tcp/127.0.0.1:7448": ["lab/tf", "sim"]}
    text = "another router of this machine, at tcp/127.0.0.1:7448, has processes: lab/tf, sim"
    step = "--connect tcp/127.0.0.1:7448 (or export ZTEAM_CONNECT=tcp/127.0.0.1:7448)"
    assert problems(check_team(Facts(routers=routers))) == [("router", text, step)]
    told = check_team(Facts(nodes=nodes("robot_0"), routers=routers))
    assert (told[0].level, told[0].text) == ("note", text)
    assert "no process sim" in {finding.text for finding in told}
    both = check_team(Facts(routers=routers, elsewhere={"lab": ["sim"]}))
    assert [(finding.what, finding.level) for finding in both] == [("namespace", "problem"), ("router", "note")]


def test_a_simulator_that_hangs_is_the_only_cause_that_is_told() -> None:
    """Scans that therefore do not come are not told too."""
    facts = team_facts(
        nodes=nodes("monitor", "robot_0", "robot_1", "sim", "tf", silent=("sim",)), sim=None, writers={"map": ["sim"]}
    )
    assert [what for what, _, _ in problems(check_team(facts))] == ["process"]


def test_real_robots_need_no_simulator() -> None:
    """If other processes publish the scans, the missing simulator is a note."""
    facts = team_facts(nodes=nodes("monitor", "robot_0", "robot_1", "tf"), sim=None, map=None)
    found = {finding.what: finding for finding in check_processes(facts)}
    assert (found["simulator"].level, found["simulator"].good) == ("note", True)
    assert found["simulator"].text == "no process sim: the robots get scans of other processes"
    assert problems(check_team(facts)) == []


def test_a_running_team_without_a_monitor_is_a_note() -> None:
    """After GO, or with --no-gate, the robots drive without it; before, they wait for it."""
    alive = nodes("robot_0", "robot_1", "sim", "tf")
    (finding,) = (found for found in check_processes(team_facts(nodes=alive)) if found.level != "ok")
    assert (finding.what, finding.level) == ("monitor", "note")
    assert finding.text == "no process monitor: all robots run, but their health is not watched"
    waiting = {0: robot_status(0), 1: robot_status(1, RobotState.READY)}
    told = problems(check_processes(team_facts(nodes=alive, statuses=waiting)))
    assert told == [("monitor", "no process monitor", "zteam-monitor --team-size 2")]

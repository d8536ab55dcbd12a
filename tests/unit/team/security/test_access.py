"""What each certificate of a team may do. Whether the router's access control does it is a matter of tests/team."""

from zteam.team.file.entries import Team
from zteam.team.file.reading import read_team_tables
from zteam.team.security.access import CHANGES, access_control, explain, rights_of


def team(**tables: object) -> Team:
    """Robots 0 and 1; robot 1 is navigated."""
    robots = [{"id": 0}, {"id": 1, "follow": 0, "navigation": True}]
    file = read_team_tables("team", {"team": {"world": "arena"}, "robots": robots, **tables})
    assert not file.mistakes
    return file.team


def test_each_process_of_a_team_has_a_certificate() -> None:
    """Simulated robots have no base, real ones have no simulator."""
    common = {"router", "tf", "monitor", "up", "view", "recorder", "operator", "robot_0", "robot_1", "nav_1"}
    node = {"name": "near", "command": ["near"]}
    assert rights_of(team(nodes=[node])).keys() == {*common, "sim", "near"}
    assert rights_of(team(team={"world": "none"})).keys() == {*common, "map", "base_0", "base_1"}


def test_nothing_is_granted_unless_the_file_says_so() -> None:
    """Only the words of the file let a certificate change something. But each may stop robots, and the operator may
    release them."""
    plain = rights_of(team())
    stop = "robot_$*/stop/engage"
    assert {each.asks for name, each in plain.items() if not each.links and name != "operator"} == {(stop,)}
    assert plain["operator"].asks == (stop, "robot_$*/stop/release")
    assert stop not in CHANGES
    granted = rights_of(team(security={"grants": {"view": ["simulation"], "robot_5": []}}))
    assert len(granted["view"].asks) > 1
    assert {*granted["view"].asks} - {stop} < {*CHANGES}
    assert "robot_5/cmd_vel" in granted["robot_5"].publishes
    assert {name: each for name, each in granted.items() if name not in ("view", "robot_5")} == {
        name: each for name, each in plain.items() if name != "view"
    }


def test_a_node_that_is_a_command_of_zteam_may_do_what_it_is_for() -> None:
    """Without a grant: the team file names the command. A node of the user's own may not."""
    nodes = [
        {"name": "errands", "command": ["zteam", "goals", "goals.yaml"]},
        {"name": "joystick", "command": ["zteam", "teleop", "--id", "0"]},
        {"name": "echo", "command": ["zteam", "topic", "echo", "map"]},
        {"name": "near", "command": ["python", "goals.py"]},
    ]
    found = rights_of(team(nodes=nodes))
    topics = {name: {key.rpartition("/")[2] for key in found[name].publishes} for name in found}
    assert "goal_pose" in topics["errands"]
    assert "cmd_vel_teleop" in topics["joystick"]
    assert {name: sum(key.startswith("robot_") for key in found[name].publishes) for name in ("echo", "near")} == {
        "echo": 0,
        "near": 0,
    }


def test_a_name_without_a_valid_certificate_has_no_rights() -> None:
    """A subject without names would be every session."""
    rights = rights_of(team())
    section = access_control(rights, {"robot_0": ["robot_0.2"], "robot_1": []})
    assert section["subjects"] == [{"id": "robot_0", "cert_common_names": ["robot_0.2"]}]
    assert [policy["subjects"] for policy in section["policies"]] == [["robot_0"]]


def test_rights_can_be_read() -> None:
    """Each row has a verb and its object; what carries the messages of others may do everything."""
    rights = rights_of(team())
    assert ("publishes", "robot_0/cmd_vel") in explain(rights["robot_0"])
    assert len(explain(rights["router"])) == 1

"""Whether data flows, and whether each robot is commanded by one process only."""

from support.team_facts import problems, sim_status, team_facts
from zteam.monitor.doctor.checks import check_data, check_writers
from zteam.monitor.doctor.facts import Facts


def test_no_data_at_all() -> None:
    """An empty bus needs a publisher."""
    assert problems(check_data(Facts())) == [("data", "no key carries data", "start a simulator or a robot")]


def test_keys_are_counted_with_the_right_plural() -> None:
    """One key is not `1 keys`."""
    assert next(check_data(Facts(writers={"clock": ["sim"]}))).text == "data on 1 key"
    assert next(check_data(team_facts())).text == "data on 7 keys"


def test_a_robot_without_scans_is_named() -> None:
    """The process of robot_1 gets no scan while the world runs."""
    writers = {key: by for key, by in team_facts().writers.items() if key != "robot_1/base_scan"}
    ((what, text, step),) = problems(check_data(team_facts(writers=writers)))
    assert (what, text) == ("data", "robot_1 gets no scan")
    assert "has the world a robot 1 with a laser?" in step


def test_no_scan_is_due_while_the_world_stands() -> None:
    """The pause is the cause, and is told by another check."""
    facts = team_facts(writers={"map": ["sim"]}, sim=sim_status(paused=True))
    assert problems(check_data(facts)) == []


def test_two_writers_of_one_command_are_named() -> None:
    """Two processes that command one robot are a problem; two that publish another key are not."""
    writers = {"robot_0/cmd_vel": ["robot_0", "session 1f"], "map": ["sim", "session 1f"]}
    assert problems(check_writers(team_facts(writers=writers))) == [
        (
            "commands",
            "robot_0/cmd_vel has 2 writers: robot_0, session 1f",
            "end all but one: their commands take turns",
        )
    ]

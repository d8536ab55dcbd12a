"""Whether data flows, and whether each robot is commanded by one process only."""

import pytest

from support.team_facts import nodes, problems, sim_status, team_facts
from zteam.monitor.doctor.checks import check_data, check_team, check_writers
from zteam.monitor.doctor.facts import Facts


def test_no_data_at_all() -> None:
    """An empty bus needs a publisher."""
    assert problems(check_data(Facts())) == [("data", "no key carries data", "start a simulator or a robot")]


def test_keys_are_counted_with_the_right_plural() -> None:
    """One key is not `1 keys`."""
    assert next(check_data(Facts(writers={"clock": ["sim"]}))).text == "data on 1 key"
    assert next(check_data(team_facts())).text == "data on 7 keys"


def test_keys_without_data_are_counted() -> None:
    """A sensor that has a publisher and carries nothing is a note; in a world that stands it is as it has to be."""
    publishers = {f"robot_0/{topic}": ["sim"] for topic in ("base_scan", "sonar_1", "odom", "tf_static")}
    (moving,) = check_data(team_facts(publishers=publishers))
    text = "data on 7 keys, none on 2 keys of sensors, such as robot_0/odom"
    assert (moving.level, moving.text) == ("note", text)
    standing = next(check_data(team_facts(publishers=publishers, sim=sim_status(paused=True))))
    assert (standing.level, standing.text) == ("ok", f"{text}: the world stands still")


def test_a_robot_without_scans_is_named() -> None:
    """The process of robot_1 gets no scan while the world runs."""
    writers = {key: by for key, by in team_facts().writers.items() if key != "robot_1/base_scan"}
    ((what, text, step),) = problems(check_data(team_facts(writers=writers)))
    assert (what, text) == ("data", "robot_1 gets no scan")
    assert step == "has robot 1 of the world a laser? see 'zteam topic list'"


def test_a_missing_simulator_is_named_before_a_robot_without_scans() -> None:
    """Where no simulator runs there is nothing to guess: its absence comes first, and is the step of the robot too."""
    facts = team_facts(sim=None, nodes=nodes("monitor", "robot_0", "tf"), writers={"robot_0/status": ["robot_0"]})
    simulator, *_, scans = problems(check_team(facts))
    assert simulator[:2] == ("simulator", "no process sim")
    assert scans[1:] == (
        "robot_0 gets no scan",
        "start what publishes its data: zteam-sim WORLD, or the driver of a real base",
    )


def test_no_scan_is_due_while_the_world_stands() -> None:
    """The pause is the cause, and is told by another check."""
    facts = team_facts(writers={"map": ["sim"]}, sim=sim_status(paused=True))
    assert problems(check_data(facts)) == []


@pytest.mark.parametrize(
    ("topic", "what", "noun"),
    [
        ("cmd_vel", "commands", "commands"),
        ("cmd_vel_teleop", "commands", "commands"),
        ("base_scan_1", "sensors", "data"),
        ("odom", "sensors", "data"),
    ],
)
def test_two_writers_of_a_key_that_has_one_are_named(topic: str, what: str, noun: str) -> None:
    """Two processes that drive one robot, or are its base, are a problem; two that publish another key are not."""
    both = ["robot_0", "session 1f"]
    writers = {f"robot_0/{topic}": both, "map": both, "robot_0/goal_pose": both, "robot_0/tf": both}
    text, step = f"robot_0/{topic} has 2 writers: robot_0, session 1f", f"end all but one: their {noun} take turns"
    assert problems(check_writers(team_facts(writers=writers))) == [(what, text, step)]


def test_a_second_publisher_that_sends_nothing_is_a_note() -> None:
    """A teleop gives way to another one, and may take the robot again; in lock-step cmd_vel has two by design."""
    publishers = {"robot_0/cmd_vel_teleop": ["zteam teleop", "view"], "robot_0/cmd_vel": ["robot_0", "sim"]}
    (found,) = check_writers(team_facts(publishers=publishers))
    text = "robot_0/cmd_vel_teleop has 2 publishers: zteam teleop, view; one of them sends"
    assert (found.level, found.what, found.text) == ("note", "commands", text)

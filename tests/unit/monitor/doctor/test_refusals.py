"""Refused messages: a problem while it happens, history afterwards."""

import pytest

from support.team_facts import problems, sim_status, team_facts
from zteam.bus.receiving import KeyCount
from zteam.monitor.doctor.checks import HISTORY_AFTER, check_refusals, check_team, format_refusals, is_recent
from zteam.monitor.doctor.facts import Facts, UnusableMessages


@pytest.mark.parametrize(
    ("count", "text"),
    [
        (KeyCount(5, 0), "none refused"),
        (KeyCount(5, 1, 3.2, "broken"), "1 refused, 3 s ago: broken"),
        (KeyCount(5, 2, 119.4, "broken"), "2 refused, the last one 119 s ago: broken"),
        (KeyCount(5, 2, 600.0, "broken"), "2 refused, the last one 10 min ago: broken"),
        (KeyCount(5, 2, 36000.0, "broken"), "2 refused, the last one 10 h ago: broken"),
        (KeyCount(5, 2), "2 refused"),
    ],
)
def test_refusals_in_words(count: KeyCount, text: str) -> None:
    """Number, age and reason of the last one; an older zteam tells the number only."""
    assert format_refusals(count) == text


def test_the_age_parts_now_from_history() -> None:
    """A refusal counts for HISTORY_AFTER seconds."""
    assert is_recent(KeyCount(0, 1, HISTORY_AFTER - 0.1, "broken"))
    assert not is_recent(KeyCount(0, 1, HISTORY_AFTER, "broken"))
    assert not is_recent(KeyCount(9, 0))
    assert is_recent(KeyCount(0, 1))


def test_what_the_router_drops_is_a_problem() -> None:
    """It names the key and the processes that publish on it; then it is not said that nothing was refused."""
    (finding,) = check_refusals(team_facts(dropped={"robot_0/near": ["far", "near"]}))
    text = "the router drops robot_0/near, which far, near publishes: the certificate may not publish it"
    assert (finding.level, finding.text) == ("problem", text)


def test_nothing_was_refused() -> None:
    """Processes that received good messages only."""
    (finding,) = check_refusals(team_facts(counts={"sim": {"robot_0/cmd_vel": KeyCount(10)}}))
    assert (finding.level, finding.text) == ("ok", "no message was refused")


def test_a_fault_names_its_writer_and_the_processes_that_refuse_it() -> None:
    """What is wrong now is told with its cause, once for each key."""
    fault = UnusableMessages(
        "robot_0/base_scan", "session 1f", "sensor_msgs/msg/Range, sensor_msgs/msg/LaserScan is due"
    )
    counts = {"robot_0": {fault.key: KeyCount(9, 3, 0.1, "wrong type")}}
    ((what, text, step),) = problems(check_refusals(team_facts(counts=counts, faults=[fault])))
    assert what == "refusals"
    assert text == (
        "robot_0/base_scan: session 1f sends sensor_msgs/msg/Range, sensor_msgs/msg/LaserScan is due; "
        "refused by robot_0"
    )
    assert step == "end or mend what sends it: 'zteam node list' has the processes"


def test_a_fault_that_no_process_receives_is_told_too() -> None:
    """A message of the wrong type is a mistake before anything subscribes to it."""
    ((_, text, _),) = problems(
        check_refusals(Facts(faults=[UnusableMessages("map", "mapper", "bytes that are no map")]))
    )
    assert text == "map: mapper sends bytes that are no map"


def test_a_refusal_of_now_without_a_fault_names_the_writer() -> None:
    """Its reason is that of the process that refused it."""
    counts = {"sim": {"robot_9/cmd_vel": KeyCount(0, 7, 2.0, "the world has no such robot")}}
    facts = team_facts(counts=counts, writers={"robot_9/cmd_vel": ["teleop"]})
    ((_, text, step),) = problems(check_refusals(facts))
    assert text == "robot_9/cmd_vel: sim: 7 refused, the last one 2 s ago: the world has no such robot"
    assert step.startswith("look at teleop, which writes robot_9/cmd_vel now; 60 s after")
    ((_, _, step),) = problems(check_refusals(team_facts(counts=counts)))
    assert step.startswith("no process writes robot_9/cmd_vel now; 60 s after")


def test_commands_of_a_robot_that_the_world_lacks_are_no_second_problem() -> None:
    """The missing robot is told as the cause, so that its refused commands are not."""
    counts = {"sim": {"robot_1/cmd_vel": KeyCount(0, 7, 2.0, "the world has no such robot")}}
    facts = team_facts(counts=counts, sim=sim_status(robots=[0]))
    assert [what for what, _, _ in problems(check_team(facts))] == ["robots"]
    assert not list(check_refusals(facts))
    assert problems(check_refusals(team_facts(counts=counts)))


def test_a_mended_refusal_is_a_note() -> None:
    """What has not happened for a minute is history: no problem, but not forgotten."""
    counts = {"sim": {"robot_0/cmd_vel": KeyCount(500, 7, 300.0, "broken")}}
    (finding,) = check_refusals(team_facts(counts=counts))
    assert (finding.good, finding.level) == (True, "note")
    assert finding.text == (
        "none within 60 s; before: robot_0/cmd_vel by sim (7 refused, the last one 5 min ago: broken)"
    )


def test_a_long_history_is_cut() -> None:
    """Five refusals of the past are listed, the others are counted."""
    counts = {"sim": {f"robot_{i}/cmd_vel": KeyCount(0, 1, 100.0, "broken") for i in range(8)}}
    (finding,) = check_refusals(Facts(counts=counts))
    assert finding.text.endswith(", and 3 more")

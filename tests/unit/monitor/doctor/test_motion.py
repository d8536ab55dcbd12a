"""Why a team does not drive."""

import msgspec
import pytest

from support.team_facts import nodes, problems, robot_status, sim_status, team_facts, team_status
from zteam.messages import RobotState
from zteam.monitor.doctor.checks import (
    check_followers,
    check_frames,
    check_gate,
    check_lasers,
    check_readiness,
    check_silence,
    check_team,
    check_world,
)
from zteam.transforms.lasers import LaserProblem


def test_a_paused_world_is_named_as_the_cause() -> None:
    """Only the pause is told, not the scans that therefore do not come."""
    facts = team_facts(sim=sim_status(paused=True), writers={"robot_0/status": ["robot_0"]})
    assert problems(check_team(facts)) == [
        ("world", "the simulator is paused at 5.000 s (tick 50)", "zteam sim resume"),
    ]


def test_robots_that_cannot_follow_are_named() -> None:
    """A circle, and a leader without a process, which is the cause of what the follower waits for; one that was lost is
    told as that."""
    circle = team_facts(statuses={0: robot_status(0, leader=1), 1: robot_status(1, leader=0)})
    assert problems(check_team(circle)) == [
        (
            "robots",
            "robots follow each other in a circle: robot_0 -> robot_1 -> robot_0",
            "let one of them lead: start robot_0 again without --follow",
        )
    ]
    waits = robot_status(1, RobotState.BOOT, text="waiting for the pose of its leader robot_9", leader=9)
    facts = team_facts(statuses={0: robot_status(0), 1: waits})
    step = "the world has no robot 9 (it has 0, 1): start robot_1 again with another --follow"
    assert problems(check_team(facts)) == [
        ("robots", "robot_1 follows robot_9, which has no process", step),
        ("robots", "robot_1 is not ready (boot): waiting for the pose of its leader robot_9", step),
    ]
    assert problems(check_followers(msgspec.structs.replace(facts, sim=sim_status(robots=[0, 1, 9]))))[0][2] == (
        "zteam-robot --id 9, or start robot_1 again with another --follow"
    )
    gone = msgspec.structs.replace(facts, team=team_status(ready=[1], missing=[], lost=[9]))
    assert list(check_followers(gone)) == []


def test_robots_that_are_stopped_are_named_with_the_way_out() -> None:
    """By their own word or the simulator's, in one line; none is said to stand for another reason."""
    held = robot_status(0, is_stopped=True, reason="stopped (zteam stop --release)")
    facts = team_facts(sim=sim_status(stopped=[1]), statuses={0: held, 1: robot_status(1)})
    assert problems(check_team(facts)) == [
        ("stop", "'zteam stop' holds robots 0, 1: nothing drives them", "zteam stop --release"),
    ]
    assert not any("stands" in finding.text for finding in check_team(facts))


def test_a_run_that_is_over_is_a_note() -> None:
    """A world that stands at the end of its run is as it was asked for."""
    (finding,) = check_world(team_facts(sim=sim_status(finished=True, paused=True)))
    assert (finding.level, finding.text) == ("note", "the run is over at 5.000 s (tick 50): the world stands still")


@pytest.mark.parametrize(
    ("silent", "step"),
    [
        (["robot_1"], "look at the log of robot_1"),
        (["robot_4"], "zteam-robot --id 4"),
        (["planner", "robot_1"], "start planner"),
        ([], "start the monitor"),
    ],
)
def test_what_holds_lock_step_is_named(silent: list[str], step: str) -> None:
    """A tick that stays the same while the simulator waits is held, and the step depends on what holds it."""
    facts = team_facts(sim=sim_status(lockstep=True, waiting_for="x", silent=silent), holds=True)
    ((what, text, told),) = problems(check_world(facts))
    assert what == "world"
    assert text == "lock-step is held at 5.000 s (tick 50): it waits for x"
    assert told.startswith(step)


def test_a_tick_that_goes_on_is_not_held() -> None:
    """Lock-step waits for a moment in every tick."""
    assert not list(check_world(team_facts(sim=sim_status(lockstep=True, waiting_for="robot_1"), holds=False)))


def test_the_gate_names_the_robots_that_it_waits_for() -> None:
    """A robot without a process is to be started."""
    team = team_status(ready=[0], missing=[1])
    facts = team_facts(nodes=nodes("monitor", "robot_0", "sim", "tf"), team=team)
    assert problems(check_gate(facts)) == [
        ("gate", "the start gate waits for robot_1 (1 of 2 ready)", "zteam-robot --id 1")
    ]


def test_the_gate_waits_for_a_robot_that_the_world_lacks() -> None:
    """The next step has the ids that the world has."""
    team = team_status(ready=[0, 1], missing=[7], size=3)
    ((_, text, step),) = problems(check_gate(team_facts(team=team)))
    assert text == "the start gate waits for robot_7 (2 of 3 ready)"
    assert step == "the world has no robot 7: zteam-monitor --ids 0,1"


def test_a_team_size_above_the_world_is_told_with_the_size_of_the_world() -> None:
    """The advice is never below the robots in the world, and the user can type it."""
    team = team_status(ready=[0], missing=[], size=4)
    facts = team_facts(team=team, nodes=nodes("monitor", "robot_0", "sim", "tf"))
    ((_, text, step),) = problems(check_gate(facts))
    assert text == "the start gate waits for 3 more of any id (1 of 4 ready)"
    assert step == "the world has 2 robots: zteam-monitor --team-size 2, or zteam sim spawn"


def test_the_words_of_the_monitor_are_kept() -> None:
    """If the monitor says what it waits for, that is what is told."""
    team = team_status(ready=[0], missing=[1])
    team.waiting_for = "robot_1 (boot)"
    ((_, text, _),) = problems(check_gate(team_facts(team=team)))
    assert text == "the start gate waits for robot_1 (boot) (1 of 2 ready)"


def test_a_lost_robot_is_told_while_it_is_in_the_world() -> None:
    """Its process was there and is gone; a robot that was taken out of the world is not missed."""
    team = team_status(ready=[0, 1], missing=[], lost=[1])
    facts = team_facts(nodes=nodes("monitor", "robot_0", "sim", "tf"), team=team)
    ((_, text, step),) = problems(check_gate(facts))
    assert text == "the process of robot_1 was there and is gone: it has ended, or is stopped (Ctrl+Z)"
    assert step.startswith("start it again: zteam-robot --id 1")
    assert not list(check_gate(team_facts(nodes=facts.nodes, team=team, sim=sim_status(robots=[0]))))


def test_the_word_of_a_monitor_that_is_gone_does_not_count() -> None:
    """The monitor's absence is told instead."""
    facts = team_facts(nodes=nodes("robot_0", "robot_1", "sim", "tf"), team=team_status(ready=[0], missing=[1]))
    assert not list(check_gate(facts))


@pytest.mark.parametrize(
    ("text", "alive", "step"),
    [
        ("waiting for its own pose in map", ("robot_0", "sim"), "zteam-tf"),
        ("waiting for its own pose in map", ("robot_0", "sim", "tf"), "'zteam topic info robot_0/base_scan' names"),
        ("waiting for a first scan (robot_0/base_scan)", ("robot_0", "tf"), "start what publishes its data"),
    ],
)
def test_a_robot_in_boot_tells_what_it_waits_for(text: str, alive: tuple[str, ...], step: str) -> None:
    """Its own words are told, and the next step for them."""
    sim = sim_status() if "sim" in alive else None
    facts = team_facts(nodes=nodes(*alive), statuses={0: robot_status(0, RobotState.BOOT, text=text)}, sim=sim)
    ((what, told, next_step),) = problems(check_readiness(facts))
    assert (what, told) == ("robots", f"robot_0 is not ready (boot): {text}")
    assert next_step.startswith(step)


def test_a_robot_that_failed_tells_why() -> None:
    """A fault is a problem."""
    facts = team_facts(statuses={0: robot_status(0, RobotState.FAULT, text="no laser")})
    assert problems(check_readiness(facts)) == [
        ("robots", "robot_0 has failed: no laser", "see its log, then start robot_0 again")
    ]


def test_a_running_robot_that_stands_is_a_note() -> None:
    """Its reason may be an obstacle, which is no problem of the team."""
    (finding,) = check_readiness(team_facts(statuses={1: robot_status(1, text="leader robot_0 not seen")}))
    assert (finding.level, finding.text) == ("note", "robot_1 stands: leader robot_0 not seen")


def test_the_status_of_a_process_that_is_gone_is_not_told() -> None:
    """A last status of a robot that ended is no state of now."""
    facts = team_facts(nodes=nodes("sim", "tf"), statuses={0: robot_status(0, RobotState.BOOT, text="waiting")})
    assert not list(check_readiness(facts))


def test_a_robot_without_a_status_hangs() -> None:
    """A process that answers but publishes no status hangs in its behaviour; one that does not answer is frozen."""
    facts = team_facts(statuses={0: robot_status(0)})
    ((what, text, step),) = problems(check_silence(facts))
    assert (what, text) == ("process", "robot_1 is alive but publishes no status: its behaviour hangs")
    assert "process 1002 on host" in step
    assert not list(check_silence(team_facts(statuses={}, nodes=nodes("robot_1", silent=("robot_1",)))))
    hangs = msgspec.structs.replace(facts, publishers={"robot_1/status": ["robot_1"]})
    assert problems(check_silence(hangs)) == problems(check_silence(facts))


def test_a_process_that_has_no_status_does_not_hang() -> None:
    """A teleop that drives a base itself holds the robot's name, and has no publisher of a status."""
    facts = team_facts(statuses={0: robot_status(0)}, publishers={"robot_1/cmd_vel": ["robot_1"]})
    (finding,) = check_silence(facts)
    assert finding.level == "note"
    assert finding.text == (
        "robot_1 is held by process 1002 on host, which publishes no status: "
        "zteam teleop, or a node without a gate, drives its base"
    )


CHAIN = {"robot_0/odom": "map", "robot_0/base_footprint": "robot_0/odom", "robot_0/base_link": "robot_0/base_footprint"}


@pytest.mark.parametrize(
    ("lacking", "edge", "key"),
    [
        ("robot_0/odom", "map -> robot_0/odom", "robot_0/tf_static or robot_0/tf"),
        ("robot_0/base_footprint", "robot_0/odom -> robot_0/base_footprint", "robot_0/tf"),
    ],
)
def test_a_robot_that_stands_without_a_pose_is_told_with_the_transform_that_lacks(
    lacking: str, edge: str, key: str
) -> None:
    """The way from `map` to its base is followed; a robot that drives, or that the world lacks, is left out."""
    frames = {child: parent for child, parent in CHAIN.items() if child != lacking}
    facts = team_facts(nodes=nodes("robot_0", "robot_7", "sim", "tf"), frames=frames)
    assert problems(check_frames(facts)) == [
        (
            "transforms",
            f"robot_0 has no pose in map: no process says {edge}",
            f"it is due on {key}: see 'zteam topic info {key.split()[0]}'",
        )
    ]
    assert "transforms" in [finding.what for finding in check_team(facts)]
    driving = msgspec.structs.replace(facts, statuses={0: robot_status(0, speed=0.3)})
    for fine in (driving, msgspec.structs.replace(facts, frames=CHAIN), msgspec.structs.replace(facts, frames=None)):
        assert not list(check_frames(fine))


def test_a_laser_without_a_place_on_its_base_is_named() -> None:
    """With its robot, its frame and the way out, also where its robot is ready; a robot that waits for it has no other
    step to take."""
    wrong = LaserProblem("its laser's frame robot_1/eye (robot_1/tf_static, from its base)", "publish it")
    waits = robot_status(1, RobotState.BOOT, text="waiting for what is told")
    facts = team_facts(lasers={"robot_1/base_scan": wrong}, statuses={0: robot_status(0), 1: waits})
    text = f"the scans of robot_1 (robot_1/base_scan) cannot be used: they need {wrong.noun}"
    assert problems(check_lasers(facts)) == [("lasers", text, "publish it")]
    ((_, _, step),) = problems(check_readiness(facts))
    assert step == "publish it"

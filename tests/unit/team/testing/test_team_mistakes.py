"""What a test asks of the `team` fixture by mistake: one line, at once, and nothing starts."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from zteam import run_team
from zteam.errors import UsageError
from zteam.team.testing.chaos import TeamChaos
from zteam.testing import Team


@pytest.fixture
def idle() -> Iterator[Team]:
    """A fixture of which nothing has been asked yet."""
    team = Team()
    yield team
    team.close()


def start(robots: Any, **how: Any) -> Callable[[Team], object]:
    """Asks for a team in the arena."""
    return lambda team: team.start("arena", robots, **how)


def yielding(_node: object) -> Iterator[None]:
    """A call makes a generator, which nothing runs."""
    yield


def start_twice(team: Team) -> None:
    """The first start is as it should be."""
    team.start("arena", in_process=True)
    team.start("arena", in_process=True)


MISTAKES: list[tuple[Callable[[Any], object], str]] = [
    (start(2, follow={0: 1, 1: 0}), "robots[0].follow: robots follow each other in a circle"),
    (start(2, follow={1: 5}), "robots[1].follow: no robot 5 in this team (it has 0, 1)"),
    (start(1, follow={5: 0}), "follow has robot 5, but robots has 0"),
    (start("0,1", params={5: {}}), "params has robot 5, but robots has 0, 1"),
    (start(1, params={0: {"sped": 1.0}}), "robots[0].sped: unknown key (did you mean speed?)"),
    (start(1, behavior="dance", in_process=True), "robots[0].behavior: no behaviour 'dance'"),
    (start([0, 7]), "robots[1].id: the world has no robot 7"),
    (start(1, nodes={"crowd": start_twice}), "nodes['crowd'] is <function start_twice"),
    (start(1, nodes={"crowd": 7}, in_process=True), "nodes['crowd'] is 7"),
    (start(1, nodes={"crowd": "no_such:main"}, in_process=True), "node 'crowd': cannot import no_such"),
    (start(1, nodes={"sim": "zteam:run"}), "node 'sim': the team has a process of this name"),
    (start(1, nodes={"a b": "zteam:run"}), "node 'a b': "),
    (lambda team: team.launch("line", in_process=True, secure="certificates"), "leave in_process out"),
    (start(1, in_process=True, chaos=True), "leave in_process out"),
    (start(2, follow=[0]), "follow is [0]: give a dict by robot, as {1: 0}"),
    (start(2, params=[0.2]), "params is [0.2]: give a dict by robot"),
    (lambda team: team.run("5"), "team.run: seconds is '5': give seconds"),
    (lambda team: team.at("5"), "team.at: tick is '5': give a tick"),
    (lambda team: team.until(True, within=1), "team.until(True, …): give a function"),
    (lambda team: team.until(lambda: True, within="1"), "team.until: within is '1': give"),
    (lambda team: team.wait_for(1.0), "team.wait_for(1.0): give a function"),
    (start(0), "give at least one robot"),
    (start(None), "team.start: robots is None: give a number of robots"),
    (start(2.0), "team.start: robots is 2.0"),
    (start([[0]]), "team.start: robots is [[0]]"),
    (start(1, params={0: 3}), "team.start: params is {0: 3}: give a dict by robot"),
    (start(1, seed="1"), "team.start: seed is '1': give a whole number"),
    (start(1, lockstep="no"), "team.start: lockstep is 'no': give True or False"),
    (start(1, lockstep_timeout="5"), "team.start: lockstep_timeout is '5': give host seconds"),
    (start(1, nodes=["a"]), "team.start: nodes is ['a']: give a dict by name"),
    (start(1, nodes={"a": yielding}, in_process=True), "without 'async' and 'yield'"),
    (start(1, expect="a"), "team.start: expect is 'a': give the names of processes"),
    (lambda team: team.launch("line", arguments=["a"]), "team.launch: arguments is ['a']: give a dict by name"),
    (lambda team: team.launch("line", secure=3), "team.launch: secure is 3: give a path"),
    (lambda team: team.at(2.5), "team.at: tick is 2.5: give a tick, a whole number"),
    (lambda team: team.stop(robots=0), "team.stop: robots is 0: give a list of robot ids"),
    (lambda team: team.release(3), "team.release: robots is 3: give a list of robot ids"),
    (lambda team: team.robot("robot_0"), "team.robot: robot_id is 'robot_0': give a robot id"),
    (lambda team: team.wait_for_processes(0), "team.wait_for_processes: processes is (0,): give the names"),
    *(
        (lambda _team, given=given: run_team("line", **given), told)
        for told, given in (
            ("run_team: seconds is ", {"seconds": "1"}),
            ("run_team: until is ", {"until": 2.5}),
            ("run_team: seed is ", {"until": 2, "seed": "1"}),
            ("run_team: nodes is ['a']: give a dict by name", {"until": 2, "nodes": ["a"]}),
            ("nodes['a'] is 3: give a function", {"until": 2, "nodes": {"a": 3}}),
            ("run_team: arguments is ['a']", {"until": 2, "arguments": ["a"]}),
            ("run_team: bus is ", {"until": 2, "bus": "tcp/127.0.0.1:7447"}),
            ("run_team: map_resolution is ", {"until": 2, "map_resolution": "0.1"}),
        )
    ),
    (start_twice, "a test has one team"),
    (lambda team: team.run(-1), "team.run: seconds is -1"),
    (lambda team: team.run(float("nan")), "team.run: seconds is nan"),
    *(
        (call, "call team.start or team.launch first")
        for call in (
            lambda team: team.run(1),
            lambda team: team.until(lambda: True, within=1),
            lambda team: team.at(3),
            lambda team: team.wait_for_go(),
        )
    ),
    *(
        (call, "there is no process 'robot_9'; this team has no process yet")
        for call in (
            lambda team: team.kill("robot_9"),
            lambda team: team.pause_process("robot_9"),
            lambda team: team.exit_code("robot_9"),
        )
    ),
]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda chaos: chaos.pause("robot_1", 0.0), "team.chaos.pause: seconds: a number of at least 0.001"),
        (lambda chaos: chaos.cut("robot_1", "1"), "team.chaos.cut: seconds is '1': give seconds"),
        (lambda chaos: chaos.slow("robot_1", delay=-1.0), "team.chaos.slow: delay: a number of at least 0"),
        (lambda chaos: chaos.slow("robot_1", rate=0.5), "team.chaos.slow: rate: a number of at least 1"),
    ],
)
def test_a_fault_that_cannot_be_is_told_in_one_line(call: Callable[[TeamChaos], object], words: str) -> None:
    """Under the names of the call's arguments, before anything of the team is looked at."""
    with pytest.raises(UsageError) as told:
        call(TeamChaos.__new__(TeamChaos))
    assert str(told.value).startswith(words)


@pytest.mark.parametrize(("call", "words"), MISTAKES, ids=[words[:40] for _, words in MISTAKES])
def test_a_mistake_is_told_in_one_line(idle: Team, call: Callable[[Any], object], words: str) -> None:
    """The call fails with a line that names what is wrong, and no process has started."""
    with pytest.raises(UsageError) as told:
        call(idle)
    assert words in str(told.value)
    assert "\n" not in str(told.value)
    assert not idle._watch.log or call is start_twice


def test_a_test_that_lets_no_time_pass_is_told(idle: Team) -> None:
    """What a failed test shows of a world that has stood still, and not of one that has gone on."""
    told = "stood still"
    assert told not in idle.report_log()
    idle.start("arena", in_process=True)
    assert told in idle.report_log()
    idle.run(0.1)
    assert told not in idle.report_log()


def test_numbers_of_numpy_are_numbers(idle: Team) -> None:
    """A test may take seeds, ids and times from arrays."""
    idle.start(
        "arena", np.arange(2), seed=np.int64(3), params={np.int64(1): {"speed": np.float32(0.25)}}, in_process=True
    )
    before = idle.now
    idle.run(np.float32(0.5))
    idle.stop(robots=range(1))
    assert idle.now - before == pytest.approx(0.5)

"""What a test asks of the `team` fixture by mistake: one line, at once, and nothing starts."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from zteam.errors import UsageError
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
    (lambda team: team.run("5"), "team.run('5'): give the seconds"),
    (lambda team: team.at("5"), "team.at('5'): give the tick"),
    (lambda team: team.until(True, within=1), "team.until(True, …): give a function"),
    (lambda team: team.until(lambda: True, within="1"), "team.until('1'): give"),
    (lambda team: team.wait_for(1.0), "team.wait_for(1.0): give a function"),
    (start(0), "give at least one robot"),
    (start_twice, "a test has one team"),
    (lambda team: team.run(-1), "team.run(-1)"),
    (lambda team: team.run(float("nan")), "team.run(nan)"),
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

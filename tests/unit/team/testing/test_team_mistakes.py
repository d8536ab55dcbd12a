"""What a test asks of the `team` fixture by mistake: one line, at once, and nothing starts."""

from collections.abc import Callable, Iterator

import pytest

from zteam.errors import UsageError
from zteam.testing import Team


@pytest.fixture
def idle() -> Iterator[Team]:
    """A fixture of which nothing has been asked yet."""
    team = Team()
    yield team
    team.close()


def start_twice(team: Team) -> None:
    """The first start is as it should be."""
    team.start("arena", in_process=True)
    team.start("arena", in_process=True)


MISTAKES: list[tuple[Callable[[Team], object], str]] = [
    (
        lambda team: team.start("arena", 2, follow={0: 1, 1: 0}),
        "team.start: robots[0].follow: robots follow each other in a circle (0 → 1 → 0); let one of them lead",
    ),
    (
        lambda team: team.start("arena", 2, follow={1: 5}),
        "team.start: robots[1].follow: no robot 5 in this team (it has 0, 1)",
    ),
    (lambda team: team.start("arena", 1, follow={5: 0}), "team.start: follow has robot 5, but robots has 0"),
    (lambda team: team.start("arena", "0,1", params={5: {}}), "team.start: params has robot 5, but robots has 0, 1"),
    (
        lambda team: team.start("arena", 1, params={0: {"sped": 1.0}}),
        "team.start: robots[0].sped: unknown key (did you mean speed?); wander takes",
    ),
    (
        lambda team: team.start("arena", 1, behavior="dance", in_process=True),
        "team.start: robots[0].behavior: no behaviour 'dance': use",
    ),
    (
        lambda team: team.start("arena", [0, 7]),
        "team.start: robots[1].id: the world has no robot 7 (it has 0, 1); model and pose add one",
    ),
    (
        lambda team: team.start("arena", 1, nodes={"crowd": start_twice}),
        "team.start: nodes['crowd'] is a function of this process: give a function of a module as text (",
    ),
    (
        lambda team: team.start("arena", 1, nodes={"crowd": 7}, in_process=True),  # type: ignore[dict-item]
        "team.start: nodes['crowd'] is 7: give text 'module:function', or a function of the node",
    ),
    (
        lambda team: team.start("arena", 1, nodes={"crowd": "no_such:main"}),
        "node 'crowd': cannot import no_such: ModuleNotFoundError: No module named 'no_such'",
    ),
    (
        lambda team: team.start("arena", 1, nodes={"crowd": "no_such:main"}, in_process=True),
        "node 'crowd': cannot import no_such: ModuleNotFoundError: No module named 'no_such'",
    ),
    (
        lambda team: team.start("arena", 1, nodes={"sim": "zteam:run"}),
        "node 'sim': the team has a process of this name",
    ),
    (lambda team: team.start("arena", 1, nodes={"a b": "zteam:run"}), "team.start: node 'a b': "),
    (
        lambda team: team.launch("line", in_process=True, secure="certificates"),
        "team.launch: secure gives certificates to processes: leave it or in_process out",
    ),
    (
        lambda team: team.start("arena", in_process=True, chaos=True),
        "team.start: chaos=True gives links to processes: leave it or in_process out",
    ),
    (lambda team: team.start("arena", 0), "team.start: robots is 0: give at least one robot"),
    (start_twice, "a test has one team, and this one has started"),
    (lambda team: team.run(-1), "team.run(-1): give the seconds of simulated time that are to pass, 0 or more"),
    (lambda team: team.run(float("nan")), "team.run(nan): give the seconds"),
    (lambda team: team.run(1), "team.run: no process runs yet: call team.start or team.launch first"),
    (lambda team: team.until(lambda: True, within=1), "team.until: no process runs yet: call team.start"),
    (lambda team: team.at(3), "team.at: no process runs yet: call team.start"),
    (lambda team: team.wait_for_go(), "team.wait_for_go: no process runs yet: call team.start"),
    (lambda team: team.kill("robot_9"), "there is no process 'robot_9'; this team has no process yet"),
    (lambda team: team.pause_process("robot_9"), "there is no process 'robot_9'; this team has"),
    (lambda team: team.exit_code("robot_9"), "there is no process 'robot_9'; this team has"),
]


@pytest.mark.parametrize(("call", "line"), MISTAKES, ids=[line[:40] for _, line in MISTAKES])
def test_a_mistake_is_told_in_one_line(idle: Team, call: Callable[[Team], object], line: str) -> None:
    """The call fails with a line that names what is wrong, and no process has started."""
    with pytest.raises(UsageError) as told:
        call(idle)
    assert str(told.value).startswith(line)
    assert "\n" not in str(told.value)
    assert idle._watch.log == [] or call is start_twice

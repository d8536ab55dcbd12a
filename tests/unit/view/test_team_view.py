"""What a view knows of its team while that changes under it."""

from types import SimpleNamespace
from typing import Any

import pytest

from zteam.bus import MemoryHub
from zteam.messages import PoseStamped
from zteam.node.process_node import ProcessNode
from zteam.node.shutdown import Stop
from zteam.view.team_view import TeamView


@pytest.fixture
def state() -> TeamView:
    """A view of a bus in memory."""
    return TeamView(ProcessNode("view", MemoryHub().bus(), Stop()))


def test_a_simulator_that_goes_while_robots_are_counted_is_no_error(state: TeamView) -> None:
    """Another thread learns of it: what was read first counts."""

    class Going(SimpleNamespace):
        @property
        def sim(self) -> Any:
            return self.seen.pop()

    state.queries = Going(seen=[None, SimpleNamespace(robots=[1, 2])], processes=dict, robots=set)  # type: ignore[assignment]
    assert state.robots() == {1, 2}


def test_an_error_of_the_thread_that_asks_ends_the_process(state: TeamView, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else pages would show an old team for ever, and nothing would say so."""

    def fail(*_: object) -> None:
        raise ValueError("unforeseen")

    monkeypatch.setattr(state, "_ask_once", fail)
    with pytest.raises(ValueError, match="unforeseen"):
        state.serve()


def test_it_knows_who_takes_goals_whatever_pages_show() -> None:
    """A page without the layers of navigation must not say that nothing takes a robot's goals."""
    hub = MemoryHub()
    queries = TeamView(ProcessNode("view", hub.bus(), Stop())).queries
    hub.bus().subscribe("robot_0/goal_pose", PoseStamped, lambda *_: None)
    queries.ask((), (), (), 0)
    assert ("robot_0/goal_pose", False) in {(each.key, each.publishes) for each in queries.declarations}

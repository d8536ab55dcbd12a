"""A view beside a team: it is started with it, and the team does not need it."""

from pathlib import Path

from zteam.names import is_view, view_name
from zteam.node.kinds import kind_of
from zteam.node.process_options import ViewOptions, from_line
from zteam.team.file.entries import NodeEntry, RobotEntry, Team
from zteam.team.launch.fork_server import PRELOADS
from zteam.team.launch.plan import plan_team, stop_order
from zteam.team.launch.team_launch import TeamLaunch

TEAM = Team(robots=[RobotEntry(id=0, behavior="forward")])
WORLD = Path("/w/arena.world")
VIEW_OPTIONS = ViewOptions(browser=False, name="view")


def test_a_team_has_a_view_only_if_it_is_asked_for() -> None:
    """Without it no process differs."""
    plain, viewed = plan_team(TeamLaunch(TEAM, WORLD)), plan_team(TeamLaunch(TEAM, WORLD, view=VIEW_OPTIONS))
    assert plain.jobs == {name: job for name, job in viewed.jobs.items() if name != "view"}
    assert plain.optional == frozenset()
    assert from_line(viewed.jobs["view"].words) == ("view", VIEW_OPTIONS)


def test_the_view_imports_while_the_router_starts() -> None:
    """It is started with the processes of the team, and reads the router's endpoint as they do."""
    assert [*plan_team(TeamLaunch(TEAM, WORLD, view=VIEW_OPTIONS)).own][-2:] == ["robot_0", "view"]


def test_the_run_does_not_wait_for_the_view() -> None:
    """It may end at any time, and starts again; the user's own nodes still count."""
    team = Team(robots=[RobotEntry(id=0, behavior="forward")], nodes=[NodeEntry(name="mine", command=["true"])])
    plan = plan_team(TeamLaunch(team, WORLD, view=VIEW_OPTIONS))
    assert plan.jobs["view"].may_end
    assert plan.jobs["view"].restarts
    assert (plan.optional, {"view", "mine"} <= plan.unawaited) == ({"view"}, True)
    assert "view" in stop_order([*plan.jobs, "router"])[0]


def test_several_views_have_different_names() -> None:
    """All are of the kind `view`, and no name of another process is."""
    names = {view_name() for _ in range(20)}
    assert len(names) == 20
    assert all(is_view(name) and kind_of(name) is kind_of("view") for name in (*names, "view"))
    assert not any(map(is_view, ("viewer", "robot_0", "sim")))


def test_a_team_without_a_view_imports_no_web_server() -> None:
    """The warm parent of such a team would only be larger."""
    assert not [module for module in PRELOADS if module.startswith("zteam.view")]

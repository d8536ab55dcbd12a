"""The rules that the entries of a team file obey together: ids, leaders, frames."""

from pathlib import Path

import pytest

from support.team_files import error_of, load, robots
from zteam.team.file.entries import behavior_of


def test_a_circle_of_followers_is_named(tmp_path: Path) -> None:
    """The error lists the robots of the circle; a chain that only leads into the circle gets no error."""
    pair = error_of(tmp_path, robots("id=0", "id=1\nfollow=2", "id=2\nfollow=1"))
    assert pair.startswith("5: robots[1].follow: robots follow each other in a circle (1 → 2 → 1)")
    tail = error_of(tmp_path, robots("id=5\nfollow=1", "id=1\nfollow=2", "id=2\nfollow=3", "id=3\nfollow=1"))
    assert tail.startswith("6: robots[1].follow: robots follow each other in a circle (1 → 2 → 3 → 1)")
    assert load(tmp_path, robots("id=3\nfollow=1", "id=2\nfollow=1", "id=1\nfollow=0", "id=0"))


def test_a_follower_has_one_leader_and_one_behaviour(tmp_path: Path) -> None:
    """`follow` with another behaviour or a second leader is refused; with behavior = "follow" it is allowed."""
    told = error_of(tmp_path, robots("id=0", "id=1\nfollow=0\nbehavior='avoid'"))
    assert told.startswith('5: robots[1].follow: both follow and behavior = "avoid"; keep one')
    told = error_of(tmp_path, robots("id=0", "id=1\nfollow=0\nleader=2"))
    assert told.startswith("6: robots[1].leader: the leader is named by follow = 0")
    team = load(tmp_path, robots("id=0", "id=1\nfollow=0\nbehavior='follow'\nmin_dist=1.0"))
    assert behavior_of(team.robots[1]) == ("follow", {"leader": 0, "min_dist": 1.0})


@pytest.mark.parametrize(
    ("table", "told"),
    [
        ("parent='map'", "3: static_transforms[0]: the key child is missing"),
        ("parent='map'\nchild='a'\nw=1", "6: static_transforms[0].w: unknown key; known: parent"),
        ("parent='map'\nchild='/map'", "parent and child must be the names of two frames"),
        ("parent='map'\nchild='/'", "parent and child must be the names of two frames"),
        ("parent='map'\nchild=''", 'static_transforms[0].child: a text of at least 1 character is expected, not ""'),
        ("parent='map'\nchild='a'\nx=nan", "static_transforms[0].x: nan is no number to place a frame with"),
        (
            "parent='map'\nchild='a'\nroll=-45",
            "static_transforms[0].roll: -45 is more than a full turn; angles are rad",
        ),
        ("parent='map'\nchild='a'\nqw=1", "a quaternion needs all of qx, qy, qz, qw"),
        ("parent='map'\nchild='a'\nqx=0\nqy=0\nqz=0\nqw=0", "its length is not 1"),
        ("parent='map'\nchild='a'\nqx=0\nqy=0\nqz=0\nqw=inf", "static_transforms[0].qw: inf is no number"),
        ("parent='map'\nchild='a'\nqx=0\nqy=0\nqz=0\nqw=1\nyaw=1", "both a quaternion and yaw, pitch, roll"),
        (
            "parent='map'\nchild='a'\n[[static_transforms]]\nparent='b'\nchild='/a'",
            "static_transforms[0] says where a",
        ),
    ],
)
def test_wrong_transforms_are_refused(tmp_path: Path, table: str, told: str) -> None:
    """A frame has one parent of another name, finite numbers, and a valid rotation."""
    assert told in error_of(tmp_path, f"[[robots]]\nid=0\n[[static_transforms]]\n{table}")


@pytest.mark.parametrize(
    ("table", "told"),
    [
        ("[robots.base]\nmax_vel_x = 0", "4: robots[0].base.max_vel_x: a number above 0 is expected, not 0"),
        ("[robots.base]\nspeed = 1", "4: robots[0].base.speed: unknown key; known: footprint, max_vel_x, min_vel_x"),
        (
            "[robots.base]\nfootprint = [\n[0, 0], [1, 0], [2, 0]]",
            "4: robots[0].base.footprint: must enclose an area",
        ),
        (
            "base = {footprint = [[0, 0], [1, 0], [1, 'a']]}",
            '3: robots[0].base.footprint[2][1]: a number is expected, not "a"',
        ),
        ("base = 'wide'", "3: robots[0].base: a table is expected, not 'wide'"),
    ],
)
def test_a_wrong_base_is_refused(tmp_path: Path, table: str, told: str) -> None:
    """The error has the line of the key within the table."""
    assert error_of(tmp_path, f"[[robots]]\nid = 0\n{table}").startswith(told)


def test_a_leader_with_mistakes_still_exists(tmp_path: Path) -> None:
    """A mistake in the leader's table is not also reported as a missing leader."""
    told = error_of(tmp_path, robots("id = 0\nbehavior = 3", "id = 1\nfollow = 0"))
    assert told == "3: robots[0].behavior: a text is expected, not 3"


@pytest.mark.parametrize(
    ("tables", "told"),
    [
        (["name='a b'\ncommand=['x']"], "4: nodes[0].name: 'a b' cannot be a name; use letters, digits"),
        (["name='tf'\ncommand=['x']"], "4: nodes[0].name: tf is a process of the team already"),
        (["name='router'\ncommand=['x']"], "4: nodes[0].name: router is a process of the team already"),
        (["name='robot_0'\ncommand=['x']"], "4: nodes[0].name: robot_0 is a process of the team already"),
        (["name='nav_0'\ncommand=['x']"], "4: nodes[0].name: nav_0 is a process of the team already"),
        (["name='up'\ncommand=['x']"], "4: nodes[0].name: up is a process of the team already"),
        (["name='view_2'\ncommand=['x']"], "4: nodes[0].name: view_2 is a process of the team already"),
        (["name='operator'\ncommand=['x']"], "4: nodes[0].name: operator is a process of the team already"),
        (["name='clock'\ncommand=['x']"], "4: nodes[0].name: clock is a topic of the team; choose another name"),
        (["name='ca'\ncommand=['x']"], "4: nodes[0].name: ca is a name that zteam uses itself"),
        (["name='a'\ncommand=['x']"] * 2, "7: nodes[1].name: nodes[0] has this name already; give each node its own"),
        (["name='a'\ncommand=[]"], "5: nodes[0].command: a list of at least 1 value is expected, not []"),
        (["name='a'\ncommand=[[1]]"], "5: nodes[0].command[0]: a text is expected, not [1]"),
        (["name='a'\ncommand=['x']\nexpects=true"], "6: nodes[0].expects: unknown key (did you mean expect?)"),
        (["name='a'"], "3: nodes[0]: the key command is missing"),
    ],
)
def test_mistakes_in_nodes_are_one_line(tmp_path: Path, tables: list[str], told: str) -> None:
    """A name that the bus can carry and that nothing else of the team has, and a command."""
    text = robots("id=0") + "".join(f"\n[[nodes]]\n{table}" for table in tables)
    assert error_of(tmp_path, text).startswith(told)


def test_a_node_may_be_a_robot_that_has_no_table(tmp_path: Path) -> None:
    """A driver of one's own; numbers and truth values in a command are its words, also as arguments."""
    text = robots("id=0") + "\n[[nodes]]\nname='robot_1'\ncommand=['python', 'drive.py', 1, true, '${gap:-2.5}']"
    (node,) = load(tmp_path, text).nodes
    assert node.command == ("python", "drive.py", "1", "true", "2.5")

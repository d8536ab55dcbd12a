"""The rules for the entries of a team file: ids, leaders, frames. Every rule returns all problems it finds."""

import math
from collections.abc import Collection, Iterator, Mapping

from zteam import names
from zteam.config.problems import Problem
from zteam.config.robot_ids import circle_from, format_robot_ids
from zteam.config.toml_values import KeyPath, toml_text
from zteam.errors import did_you_mean
from zteam.geometry import turn_problem
from zteam.team.file.entries import GRANTS, NodeEntry, RobotEntry, Security, StaticTransform, quaternion

_ROBOT_OF = (names.robot_id_of, names.navigated_robot_of)
"""Of the processes of one robot."""


def check_robots(robots: Mapping[int, RobotEntry]) -> Iterator[Problem]:
    """Problems of single robots; `robots` by index in the file."""
    for i, robot in robots.items():
        place: KeyPath = ("robots", i)
        if (robot.model is None) != (robot.pose is None):
            text = "model and pose go together (they add a robot that the world lacks); give both or neither"
            yield Problem((*place, "pose" if robot.model is None else "model"), text)
        if robot.pose is not None and not all(map(math.isfinite, robot.pose)):
            text = f"{toml_text(robot.pose)} is no pose; give finite x, y, yaw"
            yield Problem((*place, "pose"), text)
        elif robot.pose is not None and (text := turn_problem(robot.pose.yaw)):
            yield Problem((*place, "pose"), f"yaw {text}")
        yield from _check_params(place, robot)


def _check_params(place: KeyPath, robot: RobotEntry) -> Iterator[Problem]:
    for key, value in robot.params.items():
        if not key.isidentifier():
            yield Problem((*place, key), "cannot be a parameter; use letters, digits and '_'")
        try:
            toml_text(value)
        except TypeError:
            text = "a parameter is a number, text, true, false, or an array or table of such"
            yield Problem((*place, key), text)


def check_follows(robots: Mapping[int, RobotEntry], ids: Collection[int] | None) -> Iterator[Problem]:
    """Problems of leaders and followers; `ids` are all ids of the team, also those of tables with mistakes.

    None: some ids could not be read.
    """
    leaders = {robot.id: robot.follow for robot in robots.values()}
    circles: set[int] = set()
    for i, robot in robots.items():
        key, text = _check_follow(robot, ids)
        if not text and robot.id not in circles:
            circle = circle_from(robot.id, leaders)
            circles.update(circle)
            chain = " → ".join(map(str, circle))
            text = f"robots follow each other in a circle ({chain}); let one of them lead" if circle else ""
        if text:
            yield Problem(("robots", i, key), text)


def _check_follow(robot: RobotEntry, ids: Collection[int] | None) -> tuple[str, str]:
    if robot.follow is None:
        if robot.behavior == "follow":
            return "behavior", "to follow needs a leader; say follow = ID instead"
        if robot.behavior is None and "leader" in robot.params:
            return "leader", "a robot that follows says follow = ID"
        return "", ""
    if robot.behavior not in (None, "follow"):
        return "follow", f"both follow and behavior = {toml_text(robot.behavior)}; keep one of them"
    if "leader" in robot.params:
        return "leader", f"the leader is named by follow = {robot.follow}; drop the other key"
    if robot.follow == robot.id:
        return "follow", f"robot {robot.id} cannot follow itself; name another robot"
    if ids is not None and robot.follow not in ids:
        return "follow", f"no robot {robot.follow} in this team (it has {format_robot_ids(ids)})"
    return "follow", ""


def check_nodes(nodes: Mapping[int, NodeEntry], ids: Collection[int]) -> Iterator[Problem]:
    """Problems of the names of nodes; `ids` are the ids of the team's robots."""
    seen: dict[str, int] = {}
    for i, node in nodes.items():
        text = names.name_problem(node.name)
        if names.is_taken(node.name) or any(find(node.name) in ids for find in _ROBOT_OF):
            text = f"{node.name} is a process of the team already; give the node another name"
        elif node.name in seen:
            text = f"nodes[{seen[node.name]}] has this name already; give each node its own"
        seen.setdefault(node.name, i)
        if text:
            yield Problem(("nodes", i, "name"), text)


def check_grants(security: Security) -> Iterator[Problem]:
    """Problems of the names of certificates, and of what they are granted."""
    for name, words in security.grants.items():
        place: KeyPath = ("security", "grants", name)
        if text := names.name_problem(name):
            yield Problem(place, text)
        if not isinstance(words, list):
            yield Problem(place, f"a list of words is expected, such as [{toml_text(GRANTS[0])}]")
            continue
        for i, word in enumerate(words):
            if word not in GRANTS:
                text = f"{toml_text(word)} is no grant{did_you_mean(str(word), GRANTS)}; known: {', '.join(GRANTS)}"
                yield Problem((*place, i), text)


def check_transforms(transforms: Mapping[int, StaticTransform]) -> Iterator[Problem]:
    """Problems of the frames and numbers of static transforms; `transforms` by index in the file."""
    placed: dict[str, int] = {}
    for i, entry in transforms.items():
        place: KeyPath = ("static_transforms", i)
        parent, child = names.strip_slash(entry.parent), names.strip_slash(entry.child)
        if not parent or not child or parent == child:
            yield Problem(place, "parent and child must be the names of two frames")
        elif child in placed:
            text = f"static_transforms[{placed[child]}] says where {child} is; keep one of them"
            yield Problem((*place, "child"), text)
        placed.setdefault(child, i)
        wrong = [*_check_numbers(place, entry)]
        yield from wrong
        if not wrong and (text := _rotation_problem(entry)):
            yield Problem(place, text)


def _check_numbers(place: KeyPath, entry: StaticTransform) -> Iterator[Problem]:
    for field in ("x", "y", "z", "yaw", "pitch", "roll", "qx", "qy", "qz", "qw"):
        value = getattr(entry, field)
        if value is not None and not math.isfinite(value):
            yield Problem((*place, field), f"{value} is no number to place a frame with")
        elif field in ("yaw", "pitch", "roll") and (text := turn_problem(value)):
            yield Problem((*place, field), text)


def _rotation_problem(entry: StaticTransform) -> str:
    if all(q is None for q in (entry.qx, entry.qy, entry.qz, entry.qw)):
        return ""
    given = quaternion(entry)
    if not given:
        return "a quaternion needs all of qx, qy, qz, qw"
    if entry.yaw or entry.pitch or entry.roll:
        return "both a quaternion and yaw, pitch, roll; keep one of them"
    # A tiny or huge quaternion cannot be normalised without loss; a rounded unit quaternion is close to 1.
    return "" if 0.9 < math.hypot(*given) < 1.1 else "qx, qy, qz, qw is no rotation: its length is not 1"

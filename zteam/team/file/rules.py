"""The rules that the entries of a team file obey together. Every rule returns all problems it finds."""

from collections.abc import Collection, Iterator, Mapping

from zteam import names
from zteam.config.problems import Problem
from zteam.config.robot_ids import circle_from, format_robot_ids
from zteam.team.file.entries import GRANTS, NodeEntry, RobotEntry, Security, StaticTransform


def check_follows(robots: Mapping[int, RobotEntry], ids: Collection[int] | None) -> Iterator[Problem]:
    """Problems of leaders and followers; `ids` are all ids of the team, also those of tables with mistakes.

    None: some ids could not be read.
    """
    leaders = {robot.id: robot.follow for robot in robots.values()}
    circles: set[int] = set()
    for i, robot in robots.items():
        text = ""
        if robot.follow is not None and ids is not None and robot.follow not in ids:
            text = f"no robot {robot.follow} in this team (it has {format_robot_ids(ids)})"
        elif robot.id not in circles and (circle := circle_from(robot.id, leaders)):
            circles.update(circle)
            text = f"robots follow each other in a circle ({' → '.join(map(str, circle))}); let one of them lead"
        if text:
            yield Problem(("robots", i, "follow"), text)


def check_nodes(nodes: Mapping[int, NodeEntry], ids: Collection[int]) -> Iterator[Problem]:
    """Problems of the names of nodes; `ids` are the ids of the team's robots."""
    seen: dict[str, int] = {}
    for i, node in nodes.items():
        text = names.name_problem(node.name)
        if names.is_taken(node.name) or {names.robot_id_of(node.name), names.navigated_robot_of(node.name)} & {*ids}:
            text = f"{node.name} is a process of the team already; give the node another name"
        elif (first := seen.setdefault(node.name, i)) != i:
            text = f"nodes[{first}] has this name already; give each node its own"
        if text:
            yield Problem(("nodes", i, "name"), text)


def check_grants(security: Security) -> Iterator[Problem]:
    """Problems of the names of certificates, and of what they are granted."""
    for name, words in security.grants.items():
        text = names.name_problem(name)
        if not (isinstance(words, list) and all(word in GRANTS for word in words)):
            text = f"a list of these words is expected: {', '.join(GRANTS)}"
        if text:
            yield Problem(("security", "grants", name), text)


def check_transforms(transforms: Mapping[int, StaticTransform]) -> Iterator[Problem]:
    """A frame has one place."""
    seen: dict[str, int] = {}
    for i, entry in transforms.items():
        if (first := seen.setdefault(names.strip_slash(entry.child), i)) != i:
            text = f"static_transforms[{first}] says where {entry.child} is; keep one of them"
            yield Problem(("static_transforms", i, "child"), text)

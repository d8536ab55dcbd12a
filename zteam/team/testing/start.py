"""What `team.start` is given, as a team file and a launch have it: robots, behaviours and own nodes; or UsageError."""

import sys
from collections.abc import Mapping, Sequence
from typing import Any

from zteam import names
from zteam.config.robot_ids import format_robot_ids, parse_robot_ids
from zteam.errors import UsageError
from zteam.node.process_options import NodeOptions
from zteam.robot.behaviors.behavior import Behavior
from zteam.robot.behaviors.registry import BEHAVIORS
from zteam.team.launch.own_behaviors import find_body
from zteam.team.run.threads import Body


def spec_of(behavior: str | type[Behavior]) -> str:
    """The name by which a robot's process finds a behaviour."""
    if isinstance(behavior, str):
        return behavior
    if not isinstance(behavior, type):
        raise UsageError(f"team.start: behavior is {behavior!r:.60}: give a name or a class")
    shipped = [name for name, kind in BEHAVIORS.items() if kind is behavior]
    module, name = behavior.__module__, behavior.__qualname__
    if getattr(sys.modules.get(module), name, None) is not behavior:
        text = f"{name} of {module}, which no process can import: define the class at the top level of a module"
        raise UsageError(f"team.start: behavior is {text}")
    return shipped[0] if shipped else f"{module}:{name}"


def robot_tables(
    robots: int | str | Sequence[int], behavior: str, follow: Mapping[int, int], params: Mapping[int, Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """The robots of `start` as tables of a team file."""
    ids = parse_robot_ids([robots], "robots") if isinstance(robots, str) else robots
    ids = list(range(ids) if isinstance(ids, int) else ids)
    if not ids:
        raise UsageError(f"team.start: robots is {robots!r}: give at least one robot")
    for name, i in [*(("follow", i) for i in follow), *(("params", i) for i in params)]:
        if i not in ids:
            raise UsageError(f"team.start: {name} has robot {i}, but robots has {format_robot_ids(ids)}")
    how = {i: ("follow", follow[i]) if i in follow else ("behavior", behavior) for i in ids}
    return [{"id": i, how[i][0]: how[i][1], **params.get(i, {})} for i in ids]


def own_nodes(nodes: Mapping[str, Body | str], folders: Sequence[str], *, here: bool) -> dict[str, NodeOptions]:
    """Own nodes by name that are given as text; their modules are looked for in `folders` too. With `here`, in a team
    in this process, others are functions. Raises UsageError for what is neither."""
    found = dict[str, NodeOptions]()
    for name, body in nodes.items():
        if problem := names.name_problem(name):
            raise UsageError(f"team.start: node {name!r}: {problem}")
        if not (isinstance(body, str) or (here and callable(body))):
            text = "give text 'module:function', or with in_process=True the function itself"
            raise UsageError(f"team.start: nodes[{name!r}] is {body!r:.60}: {text}")
        if isinstance(body, str):
            if here:
                find_body(name, body)
            found[name] = NodeOptions(name, body, (*folders, ""))
    return found

"""Parameters as tables: what a parameter file of ROS 2, or a table of a team file, says to one robot's navigation."""

import fnmatch
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from zteam import names
from zteam.errors import UsageError

Tables = dict[str, dict[str, Any]]
"""Parameters by the name of Nav2's node; the names of nested tables are joined with dots, as in `FollowPath.plugin`."""

OWN = "navigation"
"""The node with parameters of zteam's own."""
_PARAMETERS = "ros__parameters"


def read_parameter_file(path: Path | str) -> Mapping[str, Any]:
    """The contents of a YAML file of parameters. Raises UsageError."""
    import yaml

    try:
        table = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"cannot read the parameters {path}: {error.strerror}") from None
    except (yaml.YAMLError, ValueError) as error:
        raise UsageError(f"{path} is no YAML file: {' '.join(str(error).split())}") from None
    if table is None:
        return {}
    if not isinstance(table, Mapping) or not any(True for _ in _find_nodes(table, ())):
        raise UsageError(f"{path} has no parameters: it needs a node's name and below it {_PARAMETERS}, as Nav2's file")
    return table


def tables_of_file(contents: Mapping[str, Any], robot_id: int, nodes: Iterable[str]) -> Tables:
    """What a parameter file says to these nodes of robot `robot_id`.

    A node's name may have namespaces before it (`robot_1/amcl`, or nested), and wildcards: `*` for one part, `**` for
    any. What names a node by itself counts before what names it by a wildcard.
    """
    found = sorted(_find_nodes(contents, ()), key=lambda item: "*" not in item[0])
    tables: Tables = {}
    for pattern, parameters in found:
        for node in _nodes_meant(pattern, robot_id, nodes):
            tables.setdefault(node, {}).update(flatten(parameters))
    return tables


def tables_of_team(table: Mapping[str, Any]) -> Tables:
    """What the table `navigation` of a team file says: the nodes' tables, without `ros__parameters`."""
    own = {key: value for key, value in table.items() if not isinstance(value, Mapping)}
    return {OWN: own, **{node: flatten(value) for node, value in table.items() if isinstance(value, Mapping)}}


def flatten(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested tables as one, with the names joined by dots."""
    flat: dict[str, Any] = {}
    for key, value in table.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            flat.update(flatten(value, f"{name}."))
        else:
            flat[name] = value
    return flat


def _find_nodes(table: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The name, or pattern, of each node with parameters, and the parameters."""
    for key, value in table.items():
        if key == _PARAMETERS and isinstance(value, Mapping) and path:
            yield "/".join(part.strip("/") for part in path), value
        elif isinstance(value, Mapping):
            yield from _find_nodes(value, (*path, str(key)))


# The costmaps are nodes in namespaces of their own.
_NAMES = {"local_costmap": "local_costmap/local_costmap", "global_costmap": "global_costmap/global_costmap"}


def _nodes_meant(pattern: str, robot_id: int, nodes: Iterable[str]) -> Iterator[str]:
    for node in nodes:
        full = _NAMES.get(node, node)
        prefixed = f"{names.robot_name(robot_id)}/{full}"
        if any(_matches(pattern, name) for name in (node, full, prefixed)):
            yield node


def _matches(pattern: str, name: str) -> bool:
    if pattern.startswith("**"):
        rest = pattern[2:].lstrip("/")
        return not rest or any(_matches(rest, name[i:]) for i in _starts(name))
    parts, given = pattern.split("/"), name.split("/")
    return len(parts) == len(given) and all(map(fnmatch.fnmatchcase, given, parts))


def _starts(name: str) -> list[int]:
    """Where the parts of a name begin."""
    return [0, *(i + 1 for i, letter in enumerate(name) if letter == "/")]

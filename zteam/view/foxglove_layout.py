"""A layout for Foxglove and Lichtblick, which draw most topics only when a user or a layout says so."""

import colorsys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path as FilePath
from typing import Any

import msgspec

from zteam import names
from zteam.errors import UsageError, ZteamError
from zteam.messages import (
    LaserScan,
    Marker,
    MarkerArray,
    Message,
    OccupancyGrid,
    Path,
    PolygonStamped,
    PoseArray,
    PoseStamped,
    Range,
)
from zteam.node.process_node import ProcessNode
from zteam.view.foxglove import shown_keys

_GOLDEN_TURN = 0.618034
"""Of the circle of hues: neighbours in number are far apart in colour, however many there are."""
PANEL = "3D!zteam"
LOOKS, PAUSE = 20, 0.2
"""How often the team is asked for its keys until there is a robot, and the host seconds between."""


def color_of(robot_id: int) -> str:
    """A colour for a robot, such as `#1f77b4`."""
    rgb = colorsys.hls_to_rgb(robot_id * _GOLDEN_TURN % 1.0, 0.5, 0.85)
    return "#" + "".join(f"{round(255 * part):02x}" for part in rgb)


def layout_of(keys: Mapping[str, type[Message] | None]) -> dict[str, Any]:
    """The layout: one panel from above that moves with the first robot, and shows map, frames, scans, paths, goals,
    outlines and markers. Costmaps and particles are there and hidden."""
    robots = sorted({target[0] for target in map(names.split_robot_key, keys) if target is not None})
    topics = {f"/{key}": shown for key in sorted(keys) if (shown := _settings(key, keys[key])) is not None}
    panel = {
        "cameraState": {
            "perspective": False, "distance": 25, "phi": 0, "thetaOffset": 0, "fovy": 45, "near": 0.5, "far": 5000,
            "target": [0, 0, 0], "targetOffset": [0, 0, 0], "targetOrientation": [0, 0, 0, 1],
        },
        "followMode": "follow-position",
        "followTf": names.robot_frame(robots[0], names.BASE_FOOTPRINT) if robots else names.MAP_FRAME,
        "scene": {"transforms": {"axisScale": 0.5, "labelSize": 0.1, "showLabel": True}},
        "transforms": {f"frame:{names.robot_frame(i, names.ODOM)}": {"visible": False} for i in robots},
        "topics": topics,
        "layers": {},
    }  # fmt: skip
    return {
        "configById": {PANEL: panel},
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": PANEL,
    }


def _settings(key: str, kind: type[Message] | None) -> dict[str, Any] | None:
    """How a topic is drawn; None if it is not."""
    target = names.split_robot_key(key)
    color = color_of(target[0]) if target is not None else "#888888"
    if kind is LaserScan:
        return {"visible": True, "colorMode": "flat", "flatColor": color, "pointSize": 3}
    if kind is Path:
        return {"visible": True, "type": "line", "lineWidth": 0.05, "gradient": [color, color]}
    if kind is PoseStamped:
        return {"visible": True, "type": "arrow", "color": color, "arrowScale": [0.6, 0.08, 0.08]}
    if kind in (PolygonStamped, Range):
        return {"visible": True, "color": color}
    if kind is OccupancyGrid:
        return {"visible": key == names.MAP, "colorMode": "map" if key == names.MAP else "costmap"}
    if kind is PoseArray:
        return {"visible": False, "color": color}
    return {"visible": True} if kind in (Marker, MarkerArray) else None


def write_layout(node: ProcessNode, path: FilePath, show: Callable[[str], None]) -> None:
    """Write the layout of the topics that are there now. Raises ZteamError without a robot, UsageError for the file."""
    keys: dict[str, type[Message] | None] = {}
    for _ in range(LOOKS):
        keys = shown_keys(node.bus.declarations())
        # A session that has just opened may not know all others yet.
        if _has_robot(keys) or node.wait(lambda: node.stopping, PAUSE):
            break
    if not _has_robot(keys):
        raise ZteamError("--foxglove-layout: no robot is there: start the team first (zteam up)")
    try:
        path.write_bytes(msgspec.json.format(msgspec.json.encode(layout_of(keys)), indent=1) + b"\n")
    except OSError as error:
        raise UsageError(f"--foxglove-layout {path}: {error.strerror or error}") from None
    show(f"{path}: a layout of {len(keys)} topics; open it in Foxglove or Lichtblick (Layouts, import from file)")


def _has_robot(keys: Iterable[str]) -> bool:
    return any(names.split_robot_key(key) is not None for key in keys)

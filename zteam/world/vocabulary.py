"""The names that world files use: types of models, their properties, and how each is treated.

A property of Stage is read, ignored in silence (it concerns a display, or a device that zteam has not), or ignored
with a remark (it would change what robots do). Any other property is remarked as unknown.
"""

import re
from collections.abc import Iterable, Set

from zteam.errors import did_you_mean

MEANT = " (did you mean {!r}?)"
"""In error texts."""

UNSUPPORTED = {
    "camera": "cameras are",
    "gripper": "grippers are",
    "actuator": "actuators are",
    "blinkenlight": "lights are",
    "lightindicator": "lights are",
}
"""Stage's other devices; their bodies, and the models on them, are there all the same."""

BODILESS = frozenset({"camera"})
"""Unsupported types with no body unless they have blocks."""

TYPES = frozenset({"model", "position", *UNSUPPORTED})
"""Types of models, except those that sense (`zteam.world.devices`)."""

_MODEL = {
    *("pose", "size", "origin", "color", "color_rgba", "bitmap", "bitmap_reading", "noblocks", "boundary", "name"),
    *("mass", "stack_children", "obstacle_return", "ranger_return", "laser_return"),
    *("fiducial_return", "fiducial_key", "pushable"),
}
READ: dict[str, set[str]] = {
    "world": {"name", "interval_sim", "unit_length", "unit_angle", "physics"},
    "model": _MODEL,
    "position": _MODEL
    | {"drive", "wheelbase", "velocity_bounds", "acceleration_bounds", "localization", "odom_error"}
    | {"odom_alphas", "wheel_radius", "wheel_separation"},
    "sensor": {"pose", "size", "range", "fov", "samples", "noise"},
    "block": {"points", "point[]", "z"},
}

_DISPLAY = {
    *("gui_nose", "gui_grid", "gui_outline", "gui_move", "trail_length", "trail_interval", "say", "debug"),
    *("map_resolution", "event_queue", "alwayson", "friction"),
    *("blob_return", "gripper_return"),
}
_WORLD_DISPLAY = {
    *("resolution", "show_clock", "show_clock_interval", "threads", "speedup", "paused", "confirm_on_quit", "test"),
}
SILENT: dict[str, set[str]] = {
    "world": _WORLD_DISPLAY,
    "sensor": {"color", "color_rgba"},
    "block": {"color", "color_rgba"},
}

_ENERGY = "energy is not simulated"
REMARKED: dict[str, str] = {
    "ctrl": "controllers of Stage are not run: every robot's process is its controller",
    "quit_time": "the world does not end by itself: end a run with --for SECONDS",
    "update_interval": "every sensor is read once a tick",
    "velocity": "robots start at rest",
    "localization_origin": "odometry starts at zero where the robot starts",
    **dict.fromkeys(("joules", "joules_capacity", "kjoules", "kjoules_capacity"), _ENERGY),
    **dict.fromkeys(("watts", "give_watts", "take_watts"), _ENERGY),
}
HARMLESS: dict[str, tuple[float, ...]] = {
    "velocity": (0.0,),
    "localization_origin": (0.0,),
    "quit_time": (0.0,),
    "update_interval": (100.0,),
}
"""Values of remarked properties that change nothing, and so need no remark."""

_INDEX = re.compile(r"\[\d*\]")


def remark_on(kind: str, name: str, values: Iterable[float | str], also: Set[str] = frozenset()) -> str | None:
    """The remark on a property of an entity of type `kind` ("world", "sensor", "block", a model's type), or None.

    `also` names what a model of this type reads besides the properties of every model.
    """
    plain = _INDEX.sub("[]", name)
    read = READ.get(kind, _MODEL) | also
    if plain in read or plain in SILENT.get(kind, _DISPLAY):
        return None
    if plain in REMARKED:
        harmless = plain in HARMLESS and set(values) <= set(HARMLESS[plain])
        return None if harmless else f"{name} is ignored: {REMARKED[plain]}"
    return f"unknown property {name!r:.60} is ignored{did_you_mean(plain, sorted(read), form=MEANT)}"

"""Typed reading of an entity's properties: units, lengths of tuples and bounds, with the property's place in errors.

To Stage every value is text, of which it reads what it expects at that place. So numbers pass for text here, and text
that is a number for a number. What Stage loads with something else in its stead (a fraction where it reads a whole
number, a word that it does not know) is loaded so, with a remark; what ends Stage is an error.

A property of Stage is read, ignored in silence (it concerns a display, or a device that zteam has not), or ignored
with a remark (it would change what robots do). Any other property is remarked as unknown."""

import math
import re
from collections import Counter
from collections.abc import Collection, Mapping, Set
from pathlib import Path
from typing import NamedTuple, NoReturn

import msgspec

from zteam.config.map_files import FloorMap, Grid
from zteam.errors import did_you_mean
from zteam.geometry import FAR, Pose2
from zteam.simulator.world.parser import Entity, Macro, Property, Value
from zteam.simulator.world.text import Remarks, TextPlace

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

TYPES = frozenset({"model", "position", *UNSUPPORTED})
"""Types of models, except those that sense (`zteam.simulator.world.devices`)."""

_MODEL = {
    *("pose", "size", "origin", "color", "color_rgba", "bitmap", "bitmap_reading", "noblocks", "boundary", "name"),
    *("mass", "stack_children", "obstacle_return", "ranger_return", "laser_return"),
    *("fiducial_return", "fiducial_key", "pushable"),
}
READ: dict[str, set[str]] = {
    "world": {"name", "interval_sim", "unit_length", "unit_angle", "physics"},
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
SILENT: dict[str, set[str]] = {
    "world": {
        *("resolution", "show_clock", "show_clock_interval", "threads", "speedup", "paused", "confirm_on_quit", "test")
    },
    "sensor": {"color", "color_rgba"},
    "block": {"color", "color_rgba"},
}

_ENERGY = "energy is not simulated", None
REMARKED: dict[str, tuple[str, float | None]] = {
    "ctrl": ("controllers of Stage are not run: every robot's process is its controller", None),
    "quit_time": ("the world does not end by itself: end a run with --for SECONDS", 0.0),
    "update_interval": ("every sensor is read once a tick", 100.0),
    "velocity": ("robots start at rest", 0.0),
    "localization_origin": ("odometry starts at zero where the robot starts", 0.0),
    **dict.fromkeys(("joules", "joules_capacity", "kjoules", "kjoules_capacity"), _ENERGY),
    **dict.fromkeys(("watts", "give_watts", "take_watts"), _ENERGY),
}
"""Why each is ignored, and the value, if any, that changes nothing and so needs no remark."""

_INDEX = re.compile(r"\[\d*\]")
_LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
_ANGLES = {"degrees": math.pi / 180, "radians": 1.0}


class Units(NamedTuple):
    """Metres and radians of one unit in the file."""

    length: float = 1.0
    angle: float = math.pi / 180


class Pose3(NamedTuple):
    """A pose in the plane at a height: Stage's `[x y z yaw]`."""

    x: float
    y: float
    z: float
    yaw: float

    @property
    def planar(self) -> Pose2:
        return Pose2(self.x, self.y, self.yaw)


class Size3(NamedTuple):
    """Extents in metres."""

    x: float
    y: float
    z: float


class Settings(msgspec.Struct, frozen=True):
    """Settings of a whole file."""

    folder: Path
    remarks: Remarks
    whole_bitmaps: bool = False
    macros: Mapping[str, Macro] = {}
    """Of the file, for error texts."""
    units: Units = Units()
    bitmaps: dict[tuple[Path, str], tuple[Grid, FloorMap | None, tuple[int, ...]]] = msgspec.field(default_factory=dict)
    """Bitmaps read so far, with the shapes of their pictures, by file and reading: many models may share one."""
    boxes: dict[int, list[tuple[int, int, int, int]]] = msgspec.field(default_factory=dict)
    """Rectangles of bitmaps on robots, by the bitmap's identity; none if there are too many."""
    counts: Counter[str] = msgspec.field(default_factory=Counter)
    """Of what a small file must not make so much that it takes long or fills the memory."""


class Reader:
    """An entity's properties. Every method raises WorldError with the place of a value it cannot take."""

    def __init__(self, entity: Entity, settings: Settings) -> None:
        self.entity = entity
        self.settings = settings

    def of(self, entity: Entity) -> "Reader":
        """A reader of another entity of the same file."""
        return Reader(entity, self.settings)

    def remark_unused(self, kind: str, also: Set[str] = frozenset()) -> None:
        """Note the properties that do nothing here. `kind` is "world", "sensor", "block" or a model's type. `also`
        names what a model of this type reads besides the properties of every model."""
        read, silent = READ.get(kind, _MODEL) | also, SILENT.get(kind, _DISPLAY)
        for name, found in self.entity.properties.items():
            plain = _INDEX.sub("[]", name)
            if self.settings.remarks.is_full:
                return
            if plain in REMARKED:
                reason, harmless = REMARKED[plain]
                if harmless is None or not set(found.values) <= {harmless}:
                    self.settings.remarks.add(found.place, f"{name} is ignored: {reason}")
            elif plain not in read and plain not in silent:
                hint = did_you_mean(plain, sorted(read), form=MEANT)
                self.settings.remarks.add(found.place, f"unknown property {name!r:.60} is ignored{hint}")

    def has(self, name: str) -> bool:
        return name in self.entity.properties

    def place(self, name: str) -> TextPlace:
        """Where the property stands; the entity's place if it is not set."""
        found = self.entity.properties.get(name)
        return found.place if found else self.entity.place

    def fail(self, name: str, text: str) -> NoReturn:
        raise self.place(name).error(text)

    def remark(self, name: str, text: str) -> None:
        """Note what is done about a property; with an empty name, about the entity as a whole."""
        self.settings.remarks.add(self.place(name), text)

    def add_up(self, name: str, what: str, number: int, most: int) -> None:
        """Count what all models of a world have together; raises WorldError at a property by which it is too much."""
        self.settings.counts[what] += number
        if self.settings.counts[what] > most:
            self.fail(name, f"this world has more than {most} {what}: it is refused")

    def number(self, name: str, default: float, kind: str = "n") -> float:
        """A number of a kind, as of `numbers`."""
        return self.numbers(name, kind, (default,))[0]

    def whole(self, name: str, default: int, low: int = -(2**31), high: int = 2**31 - 1) -> int:
        """A whole number of `low` to `high`; of a fraction the part before the point."""
        value = self.number(name, default)
        whole = math.trunc(value)
        if not low <= whole <= high:
            self.fail(name, f"{name} must be a whole number of {low} to {high}, not {value:g}")
        if whole != value:
            self.remark(name, f"{name} is a whole number: {whole} is taken of {value:g}, as Stage does")
        return whole

    def flag(self, name: str, default: bool) -> bool:
        """0 or 1; like Stage, any whole number but 0 is true."""
        return self.whole(name, default) != 0

    def text(self, name: str, default: str) -> str:
        """A string, or a number as it is written; of a tuple the first value."""
        found = self.entity.properties.get(name)
        if found is None:
            return default
        if not found.written:
            raise found.place.error(f'{name} takes a string, such as {name} "{default}"')
        return found.written[0]

    def texts(self, name: str) -> tuple[str, ...]:
        """A tuple of strings, empty if not set."""
        found = self.entity.properties.get(name)
        return found.written if found else ()

    def choice(self, name: str, default: str, choices: Collection[str], *, strict: bool = False) -> str:
        """One of a few strings; of any other Stage takes the default, where zteam is not `strict`."""
        value, known = self.text(name, default), ", ".join(choices)
        if value in choices:
            return value
        if strict:
            self.fail(name, f"{name} must be one of {known}, not {value!r:.60}")
        self.remark(name, f"{name} is one of {known}, not {value!r:.60}: {default} is taken, as Stage does")
        return default

    def numbers(self, name: str, kinds: str, default: tuple[float, ...]) -> tuple[float, ...]:
        """A tuple of numbers, one for each letter of `kinds`: l length, a angle, n neither; more are not looked at."""
        found = self.entity.properties.get(name)
        if found is None:
            return default
        if len(found.values) < len(kinds):
            count = f"{len(kinds)} numbers" if len(kinds) > 1 else "a number"
            raise found.place.error(f"{name} takes {count}, not {len(found.values)}")
        return tuple(self._scaled(found, kind, value) for kind, value in zip(kinds, found.values, strict=False))

    def _scaled(self, found: Property, kind: str, value: Value) -> float:
        try:
            value = float(value)
        except ValueError:
            raise found.place.error(f"{found.name} takes numbers, not the string {value!r:.60}") from None
        if kind == "a":
            value *= self.settings.units.angle
        elif kind == "l":
            value *= self.settings.units.length
            if abs(value) > FAR:
                raise found.place.error(f"{found.name}: {value:g} m is too large (at most {FAR:g} m)")
        if not math.isfinite(value):
            raise found.place.error(f"{found.name} overflows")
        return value

    def shares(self, name: str, count: int) -> tuple[float, ...]:
        """A tuple of numbers that are not negative, zero if not set."""
        values = self.numbers(name, count * "n", count * (0.0,))
        if min(values) < 0:
            self.fail(name, f"{name} must not be negative")
        return values

    def pose(self, name: str) -> Pose3:
        """`[x y z yaw]`, zero if not set."""
        return Pose3(*self.numbers(name, "llla", (0.0, 0.0, 0.0, 0.0)))

    def size(self, default: Size3) -> Size3:
        """`size [x y z]`; zero is no error here, for a model may have no body."""
        size = Size3(*self.numbers("size", "lll", default))
        if min(size) < 0:
            self.fail("size", f"size must not be negative: [{size.x:g} {size.y:g} {size.z:g}]")
        return size


def read_units(reader: Reader) -> Units:
    """`unit_length` and `unit_angle` of a world; they hold for the whole file, wherever they stand."""
    length, angle = reader.choice("unit_length", "m", _LENGTHS), reader.choice("unit_angle", "degrees", _ANGLES)
    return Units(_LENGTHS[length], _ANGLES[angle])

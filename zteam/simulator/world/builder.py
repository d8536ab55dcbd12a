"""From a parsed world file to a `World`: poses, heights and bodies worked out as Stage does.

A model's pose is in its parent's frame; its foot stands on its parent's top (`stack_children 1`, the default) or
bottom, plus its own z. `origin` moves a model's body and sensors, not its children.
"""

from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from zteam import names
from zteam.config.foreign_files import MAP_FILE, YAML_FILE, name_foreign
from zteam.config.map_files import is_floor_map
from zteam.config.simulation_options import PHYSICS
from zteam.errors import WorldError, did_you_mean
from zteam.geometry import Point2, Pose2
from zteam.simulator.world.bodies import Body, place_blocks, read_body, solid_blocks
from zteam.simulator.world.devices import MODELS
from zteam.simulator.world.model import Device, FiducialMarker, Floorplan, Limits, Obstacle, Ranger, Robot, Shape, World
from zteam.simulator.world.parser import Document, Entity, Property, parse_text, parse_world
from zteam.simulator.world.properties import MEANT, TYPES, UNSUPPORTED, Pose3, Reader, Settings, read_units
from zteam.simulator.world.text import Remarks

WHEEL_SEPARATION = 0.3
"""Metres between the wheels of a robot without a width."""
DEFAULT_MASS = 10.0
MAX_MASS = 1e6
MAX_INTERVAL_MS = 60_000
ERRATIC = """
# The laser is lowered into the body, so that robots see each other.
define erratic position
(
  size [0.35 0.35 0.25]
  origin [-0.05 0 0 0]
  drive "diff"
  ranger ( pose [0.05 0 -0.1 0] size [0.05 0.05 0.1] sensor ( range [0 30] fov 270.25 samples 1081 ) )
)
"""
"""The default robot: `add_robot` makes it of "erratic" in a world without such a macro."""


def read_robot(reader: Reader, name: str, pose: Pose2, body: Body) -> Robot:
    """A position model as it is without anything on it; raises WorldError."""
    wheelbase = reader.number("wheelbase", 1.0, "l")
    drive = reader.choice("drive", "diff", ("diff", "omni", "car"))
    if not wheelbase > 0 and drive == "car":
        reader.fail("wheelbase", f"wheelbase must be above 0, not {wheelbase:g}")
    radius = reader.number("wheel_radius", 0.05, "l")
    separation = reader.number("wheel_separation", body.size.y if body.size.y > 0 else WHEEL_SEPARATION, "l")
    if not (radius > 0 and separation > 0):
        reader.fail("wheel_radius", "wheel_radius and wheel_separation must be above 0")
    a, b, c, d = reader.shares("odom_alphas", 4)
    # Stage's `[x y z yaw]`, or `[x y yaw]` as in comments of its own worlds: fractions, and radians for yaw.
    kinds = "nna" if len(reader.texts("odom_error")) == 3 else "nnna"
    x, y, *_, yaw = reader.numbers("odom_error", kinds, (0.0, 0.0, 0.0))
    return Robot(
        name=name,
        model=reader.entity.name,
        pose=pose,
        shapes=(),
        rangers=(),
        drive=drive,
        wheelbase=wheelbase,
        velocity=_read_limits(reader, "velocity_bounds") or Limits(),
        acceleration=_read_limits(reader, "acceleration_bounds"),
        localization=reader.choice("localization", "gps", ("gps", "odom")),
        odom_error=(x, y, yaw),
        odom_alphas=(a, b, c, d),
        wheel_radius=radius,
        wheel_separation=separation,
        mass=read_mass(reader),
        color=body.surface[2],
    )


def read_mass(reader: Reader) -> float:
    """Kilograms of a robot, or of something pushed."""
    mass = reader.number("mass", DEFAULT_MASS)
    if mass > MAX_MASS:
        reader.fail("mass", f"mass must be at most {MAX_MASS:g} kg, not {mass:g}")
    if mass <= 0:
        reader.remark("mass", f"mass must be above 0, not {mass:g}: {DEFAULT_MASS:g} kg is taken; Stage ignores it")
        return DEFAULT_MASS
    return mass


def _read_limits(reader: Reader, name: str) -> Limits | None:
    """`[xmin xmax ymin ymax zmin zmax yawmin yawmax]`; None if not set. z is not used: robots stay on the ground."""
    if not reader.has(name):
        return None
    values = reader.numbers(name, "llllllaa", ())
    pairs: list[Point2] = [(values[0], values[1]), (values[2], values[3]), (values[6], values[7])]
    for (low, high), axis in zip(pairs, ("x", "y", "yaw"), strict=True):
        if low > high:
            reader.fail(name, f"{name}: the smallest {axis} {low:g} is above the largest {high:g}")
    return Limits(*pairs)


class Chassis(msgspec.Struct):
    """A robot, or something that can be pushed, while its parts are collected."""

    base: Robot | Obstacle
    shapes: list[Shape] = msgspec.field(default_factory=list)
    devices: list[Device] = msgspec.field(default_factory=list)
    markers: list[FiducialMarker] = msgspec.field(default_factory=list)

    def finished(self) -> Any:
        """The robot or the obstacle with its parts."""
        parts: dict[str, Any] = {"shapes": tuple(self.shapes), "markers": tuple(self.markers)}
        if isinstance(self.base, Robot):
            parts["rangers"] = tuple(device for device in self.devices if isinstance(device, Ranger))
            parts["devices"] = tuple(device for device in self.devices if not isinstance(device, Ranger))
        return msgspec.structs.replace(self.base, **parts)


class Mount(NamedTuple):
    """Where a model's children stand: on the ground, on a model, or on a chassis."""

    owner_from_mount: Pose2
    """The owner is the base of the chassis, or the map if there is no chassis."""
    z: float
    chassis: Chassis | None
    prefix: str
    """Prefix of the names of unnamed children."""


ORIGIN = Pose2(0.0, 0.0, 0.0)
GROUND = Mount(ORIGIN, 0.0, None, "")


class Builder:
    """Collects the entities of a world; models come in file order, a parent before its children."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._unnamed: dict[str, int] = {}
        self.floorplans: list[Floorplan] = []
        self.obstacles: list[Obstacle] = []
        self.robots: list[Chassis] = []
        self.pushed: list[Chassis] = []

    def add_model(self, entity: Entity, mount: Mount) -> None:
        if entity.type == "window":  # Stage's own window on the screen
            return
        reader = Reader(entity, self._settings)
        self._check_type(reader)
        body = read_body(reader)
        owner_from_model = mount.owner_from_mount.compose(body.pose.planar)
        foot = mount.z + body.pose.z
        name = self._name(reader, mount)
        chassis = mount.chassis
        if entity.type == "position" or (reader.flag("pushable", False) and chassis is None):
            map_from_base = chassis.base.pose.compose(owner_from_model) if chassis else owner_from_model
            chassis = self._add_chassis(reader, body, map_from_base, name)
            owner_from_model = ORIGIN
        # What stands still has its own shapes and markers, but the map has its bitmap.
        base_from_model = owner_from_model if chassis else ORIGIN
        base_from_body, lift = base_from_model.compose(body.origin.planar), foot + body.origin.z
        number = reader.whole("fiducial_return", 0)
        if number and body.bitmap is not None and chassis is None:
            reader.remark("fiducial_return", "a bitmap's fiducial_return is not seen")
        markers = (FiducialMarker(number, reader.whole("fiducial_key", 0), *base_from_model),) if number else ()
        if chassis is not None:
            blocks = solid_blocks(body, reader)
            chassis.shapes.extend(place_blocks(blocks, base_from_body, lift, body.surface))
            chassis.markers.extend(markers)
        elif body.bitmap is not None:
            (rows, columns), size, top = body.bitmap.shape, body.size, lift + body.size.z
            corner = Pose2(-size.x / 2, -size.y / 2, 0.0)
            map_from_corner = owner_from_model.compose(body.origin.planar).compose(corner)
            cell = size.x / columns, size.y / rows
            plan = Floorplan(name, body.bitmap, cell, map_from_corner, lift, top, *body.surface, body.picture)
            self.floorplans.append(plan)
        if chassis is None and body.blocks:
            shapes = place_blocks(body.blocks, base_from_body, lift, body.surface)
            title = name if body.bitmap is None else f"{name}.boundary"
            self.obstacles.append(Obstacle(title, owner_from_model, shapes, markers=markers))
        sensing = MODELS.get(entity.type)
        if sensing is not None and chassis is not None and isinstance(chassis.base, Robot):
            x, y, yaw = base_from_body
            chassis.devices.extend(sensing.read(reader, name, Pose3(x, y, lift, yaw)))
        elif sensing is not None:
            reader.remark("", f"a {entity.type} that no robot carries is not simulated")
        top = foot + (body.size.z if reader.flag("stack_children", True) else 0.0)
        own = Mount(owner_from_model, top, chassis, name + ".")
        for child in entity.children:
            if child.type == "block":
                reader.of(child).remark_unused("block")
            elif child.type != "sensor" or entity.type not in ("ranger", "laser"):
                self.add_model(child, own)

    def _add_chassis(self, reader: Reader, body: Body, map_from_base: Pose2, name: str) -> Chassis:
        entity = reader.entity
        if entity.type != "position":
            if body.bitmap is not None:
                reader.fail("pushable", "a bitmap cannot be pushed: draw the thing with block( )")
            self.pushed.append(Chassis(Obstacle(name, map_from_base, (), read_mass(reader))))
            return self.pushed[-1]
        if reader.flag("pushable", False):
            reader.fail("pushable", "a robot is moved by its drive: pushable is for other models")
        self.robots.append(Chassis(read_robot(reader, name, map_from_base, body)))
        return self.robots[-1]

    def _check_type(self, reader: Reader) -> None:
        kind, place, sensing = reader.entity.type, reader.entity.place, MODELS
        if kind in ("block", "sensor"):
            raise place.error(f"a {kind} belongs inside a {'model' if kind == 'block' else 'ranger'}")
        known, macros = TYPES | frozenset(sensing), self._settings.macros
        if kind not in known:
            if macro := macros.get(kind):
                raise place.error(f"{kind!r:.60} is defined further down, at {macro.place}: move its definition up")
            hint = did_you_mean(kind, sorted(known | macros.keys()), form=MEANT)
            text = "no type or macro has this name; 'define' it, or 'include' the file that does"
            raise place.error(f"unknown model type {kind!r:.60}{hint}: {text}")
        if kind in UNSUPPORTED:
            reader.remark("", f"{UNSUPPORTED[kind]} not simulated")
        else:
            reader.remark_unused(kind, sensing[kind].properties if kind in sensing else frozenset())

    def _name(self, reader: Reader, mount: Mount) -> str:
        """The given name, else the one that Stage makes; an unnamed robot is named by its id."""
        kind = reader.entity.type
        if reader.has("name"):
            return reader.text("name", "")
        if kind == "position":
            return names.robot_name(len(self.robots))
        stem = mount.prefix + kind
        number = self._unnamed.get(stem, 0)
        self._unnamed[stem] = number + 1
        return f"{stem}:{number}"


def load_world(path: str | Path, *, whole_bitmaps: bool = False) -> World:
    """Load a .world file with everything it includes, or a map_server YAML as a floor; either may have no robot.

    Bitmaps are read as Stage reads them, cropped to the box of their occupied pixels which is then stretched to the
    model's `size`; with `whole_bitmaps` the whole image is. A model's own `bitmap_reading "crop"` or `"whole"` wins.
    `Robot.localization` is kept as the file has it (Stage's default is "gps"), but odometry starts at zero where the
    robot starts in either case: Stage's "gps" reports the pose in the world, which no real odometry can.

    `World.warnings` lists what the file sets and zteam does not do. Raises WorldError with `file:line:column`.
    """
    path = Path(path)
    with name_foreign(path, "world file", *((MAP_FILE, YAML_FILE) if is_floor_map(path) else ())):
        return _load(path, whole_bitmaps)


def _load(path: Path, whole_bitmaps: bool) -> World:
    remarks = Remarks()
    if is_floor_map(path):
        document, whole_bitmaps = parse_text('model ( name "map" color "gray30" )', remarks, str(path)), True
        model = document.root.children[0]
        model.properties["bitmap"] = Property("bitmap", (path.name,), model.place, (path.name,))
    else:
        document = parse_world(path, remarks)
    settings = Settings(path.parent, remarks, whole_bitmaps, document.macros)
    settings = msgspec.structs.replace(settings, units=read_units(Reader(document.root, settings)))
    reader = Reader(document.root, settings)
    milliseconds = reader.number("interval_sim", 100.0)
    if not 0 < milliseconds <= MAX_INTERVAL_MS:
        reader.fail("interval_sim", f"interval_sim must be above 0 and at most {MAX_INTERVAL_MS} ms")
    builder = Builder(settings)
    reader.remark_unused("world")
    for entity in document.root.children:
        builder.add_model(entity, GROUND)
    return World(
        name=reader.text("name", path.stem),
        interval=max(1, round(milliseconds * 1e6)),
        floorplans=tuple(builder.floorplans),
        obstacles=(*builder.obstacles, *(thing.finished() for thing in builder.pushed)),
        robots=tuple(chassis.finished() for chassis in builder.robots),
        physics=reader.choice("physics", "dynamic", PHYSICS, strict=True),
        warnings=remarks.all(),
        templates={name: (document, settings) for name in document.macros if document.type_of(name) == "position"},
    )


def add_robot(world: World, model: str, pose: Pose2, name: str) -> Robot:
    """A further robot for a loaded world, from a robot macro of its file; `erratic` is known to every world.

    The robot is returned, not put into `world.robots`; remarks about its macro go to `world.warnings`. Raises
    WorldError if no macro has that name.
    """
    built_in = parse_text(ERRATIC, Remarks(), file="<built-in>"), Settings(Path(), Remarks())
    templates: dict[str, tuple[Document, Settings]] = {"erratic": built_in, **world.templates}
    if model not in templates:
        known = ", ".join(sorted(templates))
        raise WorldError(f"{world.name}: no robot macro {model!r} in this world; there are: {known}")
    (document, settings), remarks = templates[model], Remarks()
    builder = Builder(msgspec.structs.replace(settings, remarks=remarks, counts=Counter()))
    entity = document.expand(model)
    entity.properties["name"] = Property("name", (name,), entity.place, (name,))
    builder.add_model(entity, GROUND)
    if len(builder.robots) != 1:
        raise entity.place.error(f"macro {model!r} holds {len(builder.robots)} robots, not one")
    world.warnings += tuple(remark for remark in remarks.all() if remark not in world.warnings)
    robot: Robot = builder.robots[0].finished()
    return msgspec.structs.replace(robot, pose=pose)

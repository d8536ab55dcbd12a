"""From a parsed world file to a `World`: poses, heights and bodies worked out as Stage does.

A model's pose is in its parent's frame; its foot stands on its parent's top (`stack_children 1`, the default) or
bottom, plus its own z. `origin` moves a model's body and sensors, not its children.
"""

from pathlib import Path
from typing import NamedTuple

import msgspec

from zteam import names
from zteam.errors import did_you_mean
from zteam.geometry import Pose2
from zteam.simulation_options import PHYSICS
from zteam.world import vocabulary
from zteam.world.bodies import Body, Settings, place_body, place_floorplan, read_body, solid_blocks
from zteam.world.devices import device_models
from zteam.world.drives import Drive, read_drive, read_mass
from zteam.world.model import Device, Floorplan, Marker, Obstacle, Ranger, Robot, Shape, World
from zteam.world.parser import Document, Entity, Property
from zteam.world.properties import Pose3, Reader, Seat, read_units
from zteam.world.sources import Remarks

MAX_INTERVAL_MS = 60_000


class Chassis(msgspec.Struct):
    """A robot, or something that can be pushed, while its parts are collected."""

    name: str
    entity: Entity
    map_from_base: Pose2
    drive: Drive | None
    """None for what is pushed."""
    mass: float
    shapes: list[Shape] = msgspec.field(default_factory=list)
    devices: list[Device] = msgspec.field(default_factory=list)
    markers: list[Marker] = msgspec.field(default_factory=list)

    def robot(self) -> Robot:
        """As a robot."""
        assert self.drive is not None
        return Robot(
            name=self.name,
            model=self.entity.name,
            pose=self.map_from_base,
            shapes=tuple(self.shapes),
            rangers=tuple(device for device in self.devices if isinstance(device, Ranger)),
            devices=tuple(device for device in self.devices if not isinstance(device, Ranger)),
            markers=tuple(self.markers),
            **self.drive._asdict(),
        )

    def obstacle(self) -> Obstacle:
        """As something that can be pushed."""
        return Obstacle(self.name, self.map_from_base, tuple(self.shapes), self.mass, tuple(self.markers))


class Mount(NamedTuple):
    """Where a model's children stand: on the ground, on a model, or on a chassis."""

    owner_from_mount: Pose2
    """The owner is the base of the chassis, or the map if there is no chassis."""
    z: float
    chassis: Chassis | None
    prefix: str
    """Prefix of the names of unnamed children."""


GROUND = Mount(Pose2(0.0, 0.0, 0.0), 0.0, None, "")


class Template(msgspec.Struct, frozen=True):
    """A robot macro, from which further robots are made."""

    document: Document
    macro: str
    settings: Settings


def build_world(document: Document, folder: Path, whole_bitmaps: bool, remarks: Remarks, default_name: str) -> World:
    """The world of a document; bitmaps are looked for in `folder`. Raises WorldError."""
    units = read_units(document.root, remarks)
    settings = Settings(units, folder, remarks, whole_bitmaps, frozenset(document.macros))
    reader = settings.reader(document.root)
    milliseconds = reader.number("interval_sim", 100.0)
    if not 0 < milliseconds <= MAX_INTERVAL_MS:
        reader.fail("interval_sim", f"interval_sim must be above 0 and at most {MAX_INTERVAL_MS} ms")
    builder = Builder(settings)
    reader.remark_unused("world")
    for entity in document.root.children:
        builder.add_model(entity, GROUND)
    return World(
        name=reader.text("name", default_name),
        interval=max(1, round(milliseconds * 1e6)),
        floorplans=tuple(builder.floorplans),
        obstacles=(*builder.obstacles, *(thing.obstacle() for thing in builder.pushed)),
        robots=tuple(chassis.robot() for chassis in builder.robots),
        physics=reader.choice("physics", "dynamic", PHYSICS),
        warnings=remarks.all(),
        templates={
            name: Template(document, name, settings) for name in document.macros if document.type_of(name) == "position"
        },
    )


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
        """Add a model and everything on it."""
        if entity.type == "window":  # Stage's own window on the screen
            return
        reader = self._settings.reader(entity)
        self._check_type(reader)
        pose = reader.pose("pose")
        body = read_body(entity, self._settings)
        if body.home is not None and not reader.has("pose"):
            pose = Pose3(body.home.x, body.home.y, 0.0, body.home.yaw)
        owner_from_model = mount.owner_from_mount.compose(pose.planar)
        foot = mount.z + pose.z
        name = self._name(reader, mount)
        chassis = mount.chassis
        if entity.type == "position" or (reader.flag("pushable", False) and chassis is None):
            map_from_base = chassis.map_from_base.compose(owner_from_model) if chassis else owner_from_model
            chassis = self._add_chassis(reader, body, map_from_base, name)
            owner_from_model = Pose2(0.0, 0.0, 0.0)
        markers = self._read_markers(reader, body, owner_from_model if chassis else Pose2(0.0, 0.0, 0.0), chassis)
        if chassis is None:
            self._add_static(body, owner_from_model, foot, name, markers)
        else:
            blocks = solid_blocks(body, entity.place, self._settings)
            chassis.shapes.extend(place_body(body, blocks, owner_from_model, foot))
            chassis.markers.extend(markers)
        if entity.type in device_models():
            self._add_device(reader, body, owner_from_model, foot, chassis, name)
        top = foot + (body.size.z if reader.flag("stack_children", True) else 0.0)
        self._add_children(entity, Mount(owner_from_model, top, chassis, name + "."))

    def _add_chassis(self, reader: Reader, body: Body, map_from_base: Pose2, name: str) -> Chassis:
        entity = reader.entity
        if entity.type != "position":
            if body.bitmap is not None:
                reader.fail("pushable", "a bitmap cannot be pushed: draw the thing with block( )")
            self.pushed.append(Chassis(name, entity, map_from_base, None, read_mass(reader)))
            return self.pushed[-1]
        if reader.flag("pushable", False):
            reader.fail("pushable", "a robot is moved by its drive: pushable is for other models")
        drive = read_drive(reader, body.size.y, body.surface.color)
        self.robots.append(Chassis(name, entity, map_from_base, drive, drive.mass))
        return self.robots[-1]

    def _read_markers(
        self, reader: Reader, body: Body, owner_from_model: Pose2, chassis: Chassis | None
    ) -> tuple[Marker, ...]:
        number = reader.whole("fiducial_return", 0, -(2**31), 2**31 - 1)
        if number == 0:
            return ()
        if body.bitmap is not None and chassis is None:
            self._settings.remarks.add(reader.place("fiducial_return"), "a bitmap's fiducial_return is not seen")
        return (Marker(number, reader.whole("fiducial_key", 0, -(2**31), 2**31 - 1), *owner_from_model),)

    def _check_type(self, reader: Reader) -> None:
        kind, place, sensing = reader.entity.type, reader.entity.place, device_models()
        if kind in ("block", "sensor"):
            raise place.error(f"a {kind} belongs inside a {'model' if kind == 'block' else 'ranger'}")
        known = vocabulary.TYPES | frozenset(sensing)
        if kind not in known:
            hint = did_you_mean(kind, sorted(known | self._settings.macros), form=vocabulary.MEANT)
            text = "no type or macro has this name; 'define' it, or 'include' the file that does"
            raise place.error(f"unknown model type {kind!r:.60}{hint}: {text}")
        if kind in vocabulary.UNSUPPORTED:
            reader.remark_entity(f"{vocabulary.UNSUPPORTED[kind]} not simulated")
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

    def _add_static(
        self, body: Body, map_from_model: Pose2, foot: float, name: str, markers: tuple[Marker, ...]
    ) -> None:
        if body.bitmap is not None:
            self.floorplans.append(place_floorplan(body, body.bitmap, map_from_model, foot, name))
            name += ".boundary"
        blocks = [*body.blocks, *body.slabs]
        if blocks:
            shapes = place_body(body, blocks, Pose2(0.0, 0.0, 0.0), foot)
            self.obstacles.append(Obstacle(name, map_from_model, shapes, markers=markers))

    def _add_device(
        self, reader: Reader, body: Body, base_from_model: Pose2, foot: float, chassis: Chassis | None, name: str
    ) -> None:
        """Add the devices of a sensing model; unlike children, they move with the model's origin."""
        kind = reader.entity.type
        if chassis is None or chassis.drive is None:
            reader.remark_entity(f"a {kind} that no robot carries is not simulated")
            return
        seat = Seat(base_from_model.compose(body.origin.planar), foot + body.origin.z)
        chassis.devices.extend(device_models()[kind].read(reader, name, seat))

    def _add_children(self, entity: Entity, mount: Mount) -> None:
        for child in entity.children:
            if child.type == "sensor" and entity.type in ("ranger", "laser"):
                continue
            if child.type == "block":
                self._settings.reader(child).remark_unused("block")
            else:
                self.add_model(child, mount)


def build_robot(entity: Entity, settings: Settings, name: str, pose: Pose2) -> Robot:
    """The robot of a macro, under a name and at a start pose of its own; raises WorldError."""
    named = Property("name", (name,), False, entity.place, (name,))
    builder = Builder(settings)
    builder.add_model(msgspec.structs.replace(entity, properties=entity.properties | {"name": named}), GROUND)
    if len(builder.robots) != 1:
        raise entity.place.error(f"macro {entity.name!r} holds {len(builder.robots)} robots, not one")
    builder.robots[0].map_from_base = pose
    return builder.robots[0].robot()

"""Types of visualization_msgs, as in ROS 2 Jazzy."""

import msgspec

from zteam.messages.geometry_msgs import Point, Pose, Vector3
from zteam.messages.message import Message, Uint8Seq, bool_, float32, int32, zeros
from zteam.messages.sensor_msgs import CompressedImage
from zteam.messages.std_msgs import ColorRGBA, Duration, Stamped


class UVCoordinate(Message):
    """A place in a texture, 0 to 1 from its lower left corner."""

    u: float32 = 0.0
    v: float32 = 0.0


class MeshFile(Message):
    """A mesh file with its name."""

    filename: str = ""
    data: Uint8Seq = zeros("uint8")


class Marker(Stamped):
    """Something to draw; `type` is one of MarkerType, `action` one of MarkerAction."""

    ns: str = ""
    id: int32 = 0
    type: int32 = 0
    action: int32 = 0
    pose: Pose = msgspec.field(default_factory=Pose)
    scale: Vector3 = msgspec.field(default_factory=Vector3)
    color: ColorRGBA = msgspec.field(default_factory=ColorRGBA)
    lifetime: Duration = msgspec.field(default_factory=Duration)
    frame_locked: bool_ = False
    points: list[Point] = msgspec.field(default_factory=list)
    colors: list[ColorRGBA] = msgspec.field(default_factory=list)
    texture_resource: str = ""
    texture: CompressedImage = msgspec.field(default_factory=CompressedImage)
    uv_coordinates: list[UVCoordinate] = msgspec.field(default_factory=list)
    text: str = ""
    mesh_resource: str = ""
    mesh_file: MeshFile = msgspec.field(default_factory=MeshFile)
    mesh_use_embedded_materials: bool_ = False


class MarkerArray(Message):
    """Markers that were sent together."""

    markers: list[Marker] = msgspec.field(default_factory=list)


class MarkerType:
    """Values of Marker.type."""

    ARROW = 0
    CUBE = 1
    SPHERE = 2
    CYLINDER = 3
    LINE_STRIP = 4
    LINE_LIST = 5
    CUBE_LIST = 6
    SPHERE_LIST = 7
    POINTS = 8
    TEXT_VIEW_FACING = 9
    MESH_RESOURCE = 10
    TRIANGLE_LIST = 11


class MarkerAction:
    """Values of Marker.action."""

    ADD = 0
    DELETE = 2
    DELETEALL = 3

"""`load_world` and `add_robot`, the entry points of this package."""

from pathlib import Path

import msgspec

from zteam.errors import WorldError
from zteam.geometry import Pose2
from zteam.world.bodies import Bounds, Settings
from zteam.world.builder import Template, build_robot, build_world
from zteam.world.floor_maps import is_floor_map
from zteam.world.model import Robot, World
from zteam.world.parser import Property, parse_text, parse_world
from zteam.world.properties import Units
from zteam.world.sources import Remarks

BUILT_IN = """
# The default robot: `add_robot` makes it of "erratic" in a world without such a macro. The laser is lowered into
# the body, so that robots see each other.
define erratic position
(
  size [0.35 0.35 0.25]
  origin [-0.05 0 0 0]
  drive "diff"
  ranger ( pose [0.05 0 -0.1 0] size [0.05 0.05 0.1] sensor ( range [0 30] fov 270.25 samples 1081 ) )
)
"""


FLOOR = 'model ( name "map" color "gray30" )'


def load_world(path: str | Path, *, whole_bitmaps: bool = False) -> World:
    """Load a .world file with everything it includes, or a map_server YAML as a floor; either may have no robot.

    Bitmaps are read as Stage reads them, cropped to the box of their occupied pixels which is then stretched to the
    model's `size`; with `whole_bitmaps` the whole image is. A model's own `bitmap_reading "crop"` or `"whole"` wins.
    `Robot.localization` is kept as the file has it (Stage's default is "gps"), but odometry starts at zero where the
    robot starts in either case: Stage's "gps" reports the pose in the world, which no real odometry can.

    `World.warnings` lists what the file sets and zteam does not do. Raises WorldError with
    `file:line:column`.
    """
    path = Path(path)
    remarks = Remarks()
    if is_floor_map(path):
        document = parse_text(FLOOR, remarks, str(path))
        model = document.root.children[0]
        model.properties["bitmap"] = Property("bitmap", (path.name,), False, model.place, (path.name,))
        return build_world(document, path.parent, True, remarks, default_name=path.stem)
    document = parse_world(path, remarks)
    return build_world(document, path.parent, whole_bitmaps, remarks, default_name=path.stem)


def add_robot(world: World, model: str, pose: Pose2, name: str) -> Robot:
    """A further robot for a loaded world, from a robot macro of its file; `erratic` is known to every world.

    The robot is returned, not put into `world.robots`; remarks about its macro go to `world.warnings`. Raises
    WorldError if no macro has that name.
    """
    template = world.templates.get(model)
    if template is None and model == "erratic":
        document = parse_text(BUILT_IN, Remarks(), file="<built-in>")
        template = Template(document, "erratic", Settings(Units(), Path(), Remarks()))
    if template is None:
        known = ", ".join(sorted({*world.templates, "erratic"}))
        raise WorldError(f"{world.name}: no robot macro {model!r} in this world; there are: {known}")
    remarks = Remarks()
    settings = msgspec.structs.replace(template.settings, remarks=remarks, bounds=Bounds())
    robot = build_robot(template.document.expand(template.macro), settings, name, pose)
    world.warnings += tuple(remark for remark in remarks.all() if remark not in world.warnings)
    return robot

"""Whether a map lies where the world is that the team drives in."""

import math
from collections.abc import Iterator

import msgspec

from zteam import names
from zteam.geometry import Pose2, normalize_angle
from zteam.monitor.doctor.facts import Facts, Finding, note, ok, problem
from zteam.simulator.client import MapInfo, SimStatus, map_info

_TURN = 0.01
"""Radians by which a map may be turned."""
_RESOLUTION = 1e-3
"""Share by which a resolution may differ: it travels as a 32-bit number."""


def check_map(facts: Facts) -> Iterator[Finding]:
    """Whether there is a map for those that need one; compare what a subscriber gets with the simulator's world."""
    message, sim = facts.map, facts.sim
    waiting = sorted(name for name in facts.alive if names.navigated_robot_of(name) is not None)
    if message is None and waiting:
        text = f"nothing publishes '{names.MAP}', without which {', '.join(waiting)} cannot work"
        yield problem("map", text, "zteam-map MAP.yaml")
    if message is None or sim is None or sim.map is None:
        return
    others = [writer for writer in facts.writers.get(names.MAP, ()) if writer != facts.map_writer]
    name = f"'{names.MAP}' of {facts.map_writer}" + (f" (newer than that of {', '.join(others)})" if others else "")
    if message.header.frame_id != names.MAP_FRAME:
        text = f"{name} is in the frame {message.header.frame_id!r}, not in {names.MAP_FRAME!r}"
        yield problem("map", text, f"let {facts.map_writer} publish it in the frame {names.MAP_FRAME!r}")
    else:
        yield compare_with_world(name, map_info(message.info), sim.map, sim.world)


def check_map_file(name: str, found: MapInfo, sim: SimStatus | None) -> Finding:
    """Compare the map in a file with the grid of the simulator's world."""
    if sim is None or sim.map is None:
        return problem("map file", f"no simulator to compare {name} with", "zteam-sim WORLD")
    return msgspec.structs.replace(compare_with_world(name, found, sim.map, sim.world), what="map file")


def compare_with_world(name: str, found: MapInfo, world: MapInfo, world_name: str) -> Finding:
    """Whether the map `name` lies as the grid of the world does.

    A map of the same number of cells, or of the same size in metres, is meant to be one of this world, so it has to lie
    there. Any other map may show another part of it.
    """
    differences = find_differences(found, world)
    size = f"{found.columns} x {found.rows} cells of {found.resolution:.6g} m"
    if not differences:
        return ok("map", f"{name} lies as the world {world_name} does ({size})")
    same_cells = (found.columns, found.rows) == (world.columns, world.rows)
    step = (
        f"the world's grid has origin [{world.x:.6g}, {world.y:.6g}, {world.yaw:.6g}], "
        f"resolution {world.resolution:.6g}, {world.columns} x {world.rows} cells"
    )
    text = f"{name} differs from the world {world_name}: {'; '.join(differences)}"
    if same_cells or _has_size_of(found, world) or not _overlaps(found, world):
        return problem("map", text, step)
    return note("map", f"{text}: it may show another part", step)


def find_differences(found: MapInfo, world: MapInfo) -> list[str]:
    """What differs in where a map lies, in words; a finer or coarser map of the same area does not differ."""
    cell = max(world.resolution, found.resolution)
    dx, dy, turn = found.x - world.x, found.y - world.y, normalize_angle(found.yaw - world.yaw)
    differences = []
    # `not <=`: a number that is none differs.
    if not math.hypot(dx, dy) <= cell / 2:
        at, due = f"({found.x:.6g}, {found.y:.6g})", f"({world.x:.6g}, {world.y:.6g})"
        differences.append(f"origin {at} instead of {due} m, shifted by {dx:+.2f} m in x and {dy:+.2f} m in y")
    if not abs(turn) <= _TURN:
        differences.append(f"turned by {turn:+.3f} rad")
    if not _has_size_of(found, world):
        size, due = (f"{m.columns * m.resolution:.6g} x {m.rows * m.resolution:.6g}" for m in (found, world))
        if not abs(found.resolution - world.resolution) <= _RESOLUTION * world.resolution:
            differences.append(f"resolution {found.resolution:.6g} instead of {world.resolution:.6g} m")
        differences.append(f"size {size} instead of {due} m")
    return differences


def _has_size_of(found: MapInfo, world: MapInfo) -> bool:
    # Sizes are rounded up to whole cells.
    slack = 1.5 * max(found.resolution, world.resolution)
    width = found.columns * found.resolution - world.columns * world.resolution
    height = found.rows * found.resolution - world.rows * world.resolution
    return abs(width) < slack and abs(height) < slack


def _overlaps(found: MapInfo, world: MapInfo) -> bool:
    (left, bottom, right, top), (low_x, low_y, high_x, high_y) = _box(found), _box(world)
    return left < high_x and low_x < right and bottom < high_y and low_y < top


def _box(grid: MapInfo) -> tuple[float, float, float, float]:
    """Least x and y, greatest x and y."""
    width, height = grid.columns * grid.resolution, grid.rows * grid.resolution
    origin = Pose2(grid.x, grid.y, grid.yaw)
    xs, ys, _ = zip(*(origin.compose(Pose2(u, v, 0.0)) for u in (0.0, width) for v in (0.0, height)), strict=True)
    return min(xs), min(ys), max(xs), max(ys)

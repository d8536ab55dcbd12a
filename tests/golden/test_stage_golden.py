"""Laser, heights and motion agree with recordings from Stage itself (their FORMAT.md gives the tolerances)."""

import hashlib
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from support.recordings import SETS, bitmaps, stage
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.sim import Engine, Options
from zteam.world import World, load_world

on_every_set = pytest.mark.parametrize("which", SETS)


def _load(tmp_path: Path, text: str, bitmap: Path | None = None) -> World:
    """Load a world from its text, with its bitmap in the same directory."""
    if bitmap is not None and not (tmp_path / bitmap.name).exists():
        (tmp_path / bitmap.name).symlink_to(bitmap)
    path = tmp_path / "recorded.world"
    path.write_text(text)
    return load_world(path)


def _scan(engine: Engine, poses: list[list[float]], robot: int, ranger: int) -> np.ndarray:
    """The ranges of a ranger with its robot at each of the poses (x, y, yaw_deg)."""
    found = []
    for x, y, yaw_deg in poses:
        engine.place(robot, Pose2(x, y, math.radians(yaw_deg)))
        found.append(engine.observe().robots[robot].readings[ranger].ranges)
    return np.array(found)


NAMED = {"own": ("arena", "office"), "full": ("willow", "cave")}
KINDS = ("urg", "sick")
CELL = 0.02
"""Metres: Stage's raster in the recordings."""


def _open(which: str, name: str, folder: Path) -> tuple[Any, World]:
    """A recording of scans and its world."""
    recorded = next(w for w in stage(which, "scans")["worlds"] if w["name"] == name)
    bitmap = bitmaps(which, recorded) / recorded["bitmap"] if recorded["bitmap"] else None
    if bitmap is not None and "bitmap_sha256" in recorded:
        digest = hashlib.sha256(bitmap.read_bytes()).hexdigest()
        assert digest == recorded["bitmap_sha256"], f"{bitmap.name} was redrawn: its scans must be recorded anew"
    return recorded, _load(folder, recorded["world"], bitmap)


@pytest.mark.parametrize(("which", "name"), [(which, name) for which in SETS for name in NAMED[which]])
def test_scans_are_exact_and_agree_with_stage(which: str, name: str, tmp_path: Path) -> None:
    """99.9 % of the rays are within 1 mm of an exact caster, and Stage agrees with zteam as often as with it."""
    recorded, world = _open(which, name, tmp_path)
    engine = Engine(world, options=Options(physics="kinematic"))
    for kind in KINDS:
        scans = [s for s in recorded["scans"] if s["ranger"] == kind]
        robot, ranger = _find_ranger(world, len(scans[0]["ranges"]))
        ours = _scan(engine, [s["pose"] for s in scans], robot, ranger)
        exact = np.array([s["exact"] for s in scans])
        theirs = np.array([s["ranges"] for s in scans])
        agreement = recorded["agreement"][kind]
        assert np.mean(np.abs(ours - exact) <= 1e-3) >= 0.999
        assert np.mean(np.abs(ours - theirs) <= 0.05) >= agreement["within_0_05"] - 0.01
        assert np.mean(np.abs(ours - theirs) <= 0.1) >= agreement["within_0_1"] - 0.01


def _find_ranger(world: World, samples: int) -> tuple[int, int]:
    for i, robot in enumerate(world.robots):
        for j, ranger in enumerate(robot.rangers):
            if ranger.samples == samples:
                return i, j
    raise AssertionError(f"no ranger with {samples} samples")


@on_every_set
def test_heights_decide_what_a_laser_sees(which: str, tmp_path: Path) -> None:
    """In every recorded scene a laser's hits on robots and boxes agree with Stage's as often as an exact laser's."""
    recorded = stage(which, "scenes")
    close: dict[str, list[np.ndarray]] = {}
    for scene in recorded["scenes"]:
        world = _load(tmp_path, scene["world"])
        observation = Engine(world).observe()
        by_name = {robot.name: i for i, robot in enumerate(world.robots)}
        for scan in scene["scans"]:
            if "inclusive_boundary" in scene.get("tags", []):
                continue
            i = by_name[scan["robot"]]
            ours = observation.robots[i].readings[0].ranges
            limit = world.robots[i].rangers[0].range_max
            theirs = np.array(scan["ranges"])
            assert (ours < limit).any() == (theirs < limit).any(), (scene["name"], scan["robot"])
            close.setdefault(scene["name"].split("_")[0], []).append(np.abs(ours - theirs) <= 0.05)
    assert close.keys() == recorded["agreement"].keys()
    for group, found in close.items():
        least = 0.98 if which == "full" else recorded["agreement"][group]["within_0_05"] - 0.01
        assert np.mean(np.concatenate(found)) >= least, group


@on_every_set
def test_sensors_are_where_stage_had_them(which: str, tmp_path: Path) -> None:
    """In every recorded scene with heights, the origin of each ray agrees with Stage's."""
    checked = 0
    for scene in stage(which, "scenes")["scenes"]:
        robots = {robot.name: robot for robot in _load(tmp_path, scene["world"]).robots}
        for scan in scene["scans"]:
            (ranger,) = robots[scan["robot"]].rangers
            x, y, degrees = scan["pose"]
            at = Pose2(x, y, math.radians(degrees)).compose(Pose2(ranger.x, ranger.y, ranger.yaw))
            assert [at.x, at.y, ranger.z] == pytest.approx(scan["origin"][:3], abs=1e-8)
            assert abs(math.remainder(at.yaw - scan["origin"][3], math.tau)) < 1e-8
            assert (ranger.samples, math.degrees(ranger.fov)) == (scan["samples"], pytest.approx(scan["fov_deg"]))
            checked += 1
    assert checked >= 30


@on_every_set
def test_free_motion_follows_the_exact_arc(which: str, tmp_path: Path) -> None:
    """A robot in free space drives exact arcs; they differ from Stage's Euler steps as much as was recorded."""
    for run in stage(which, "motion")["free"]:
        engine = Engine(_load(tmp_path, run["world"]))
        expected = engine.truth(0)
        for v, vy, w in run["commands"]:
            engine.step({0: Twist(Vector3(v, vy), Vector3(0.0, 0.0, w))})
            expected = _arc(expected, v, vy if run["drive"] == "omni" else 0.0, w)
        assert engine.truth(0)[:2] == pytest.approx(expected[:2], abs=1e-9), run["name"]
        ours, theirs = engine.truth(0), run["trace"][-1]["pose"]
        assert math.dist(ours[:2], theirs[:2]) <= run["compare"]["arc_max_dist"] + 1e-3


def _arc(pose: Pose2, v: float, vy: float, w: float) -> Pose2:
    """The pose after 0.1 s at constant velocity, which is limited to Stage's default limits."""
    v, vy = max(-1.0, min(1.0, v)), max(-1.0, min(1.0, vy))
    w = max(-math.pi / 2, min(math.pi / 2, w))
    turn = 0.1 * w
    heading = pose.yaw + turn / 2
    chord = 0.1 * (math.sin(turn / 2) / (turn / 2) if turn else 1.0)
    return Pose2(
        pose.x + chord * (math.cos(heading) * v - math.sin(heading) * vy),
        pose.y + chord * (math.sin(heading) * v + math.cos(heading) * vy),
        pose.yaw + turn,
    )


@on_every_set
def test_stages_own_steps_are_reproduced(which: str, tmp_path: Path) -> None:
    """With `physics="stage"` every pose of every recorded free run is Stage's to 1e-8, at every tick."""
    for run in stage(which, "motion")["free"]:
        engine = Engine(_load(tmp_path, run["world"]), options=Options(physics="stage"))
        for command, recorded in zip(run["commands"], run["trace"][1:], strict=True):
            truth = engine.step({0: _twist(command)}).robots[0].truth
            x, y, yaw = recorded["pose"]
            assert truth[:2] == pytest.approx((x, y), abs=1e-8), run["name"]
            assert abs(math.remainder(truth.yaw - yaw, math.tau)) < 1e-8, run["name"]


@on_every_set
@pytest.mark.parametrize("physics", ["stage", "kinematic"])
def test_collisions_refuse_the_move_as_stage_does(physics: str, which: str, tmp_path: Path) -> None:
    """Stalls come at Stage's tick and place, within its raster; no robot slides along a wall, and reversing frees."""
    for run in stage(which, "motion")["collisions"]:
        traces = _collide(run, physics, tmp_path)
        if "first_stall_tick" in run:
            _check_stall(run, traces["a"])
        else:
            _check_meeting(run, traces)


@pytest.mark.parametrize("physics", ["stage", "kinematic"])
def test_collisions_are_those_of_a_fine_raster(physics: str, tmp_path: Path) -> None:
    """With cells of 1 mm Stage stops a single cart at the very tick and pose of exact polygons."""
    runs = [run for run in stage("own", "motion")["collisions"] if "first_stall_tick" in run]
    for run in runs:
        trace, fine = _collide(run, physics, tmp_path)["a"], run["fine"]
        stalls = [tick for tick, seen in enumerate(trace, 1) if seen.stall]
        assert (stalls[0], len(stalls)) == (fine["first_stall_tick"], fine["stall_ticks"]), run["name"]
        assert trace[stalls[0] - 1].truth == pytest.approx(fine["stall_pose"], abs=1e-8), run["name"]
        assert trace[-1].truth == pytest.approx(fine["final_pose"], abs=1e-8), run["name"]
    assert len(runs) == 8


def _collide(run: Any, physics: str, folder: Path) -> dict[str, list[Any]]:
    """The states of all robots in zteam's repetition of a recorded run, for each tick."""
    world = _load(folder, run["world"])
    ids = {robot.name: i for i, robot in enumerate(world.robots)}
    engine = Engine(world, options=Options(physics=physics))  # type: ignore[arg-type]
    traces: dict[str, list[Any]] = {name: [] for name in ids}
    for commands in run["commands"]:
        seen = engine.step({ids[name]: _twist(command) for name, command in commands.items()})
        for name, i in ids.items():
            traces[name].append(seen.robots[i])
    return traces


def _check_stall(run: Any, trace: list[Any]) -> None:
    stalls = [k + 1 for k, seen in enumerate(trace) if seen.stall]
    recorded = [k for k, seen in enumerate(run["trace"]["a"]) if seen["stall"]]
    slack = run.get("stall_tick_slack", 1 if "spin" in run["name"] else 2)
    assert abs(stalls[0] - run["first_stall_tick"]) <= slack, run["name"]
    assert (stalls[-1] == len(trace)) == (recorded[-1] == len(trace)), run["name"]
    ours, theirs = trace[stalls[0] - 1].truth, run["stall_pose"]
    along = run["commands"][0]["a"][0] * 0.1
    dx, dy = ours.x - theirs[0], ours.y - theirs[1]
    heading = theirs[2]
    assert abs(math.cos(heading) * dx + math.sin(heading) * dy) <= along + 0.02, run["name"]
    assert abs(math.cos(heading) * dy - math.sin(heading) * dx) <= 1e-6, run["name"]


def _check_meeting(run: Any, traces: dict[str, list[Any]]) -> None:
    a, b = traces["a"][-1], traces["b"][-1]
    assert {"a": int(a.stall), "b": int(b.stall)} == run["stall"], run["name"]
    gap = abs(b.truth.x - a.truth.x) - 0.25
    assert -1e-9 <= gap <= run["step_sum_m"] + 0.04, run["name"]
    assert abs(a.truth.y) <= 1e-6, run["name"]


def _twist(command: list[float]) -> Twist:
    return Twist(Vector3(command[0], command[1]), Vector3(0.0, 0.0, command[2]))

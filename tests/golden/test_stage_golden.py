"""The laser, the heights and the motion against what was recorded from Stage itself (tolerances: its FORMAT.md)."""

import math
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.sim import Engine, Options
from zteam.world import World, load_world


def _load(tmp_path: Path, text: str, folder: Path) -> World:
    """A world from its text, its bitmaps and includes found in `folder`."""
    for entry in folder.iterdir():
        link = tmp_path / entry.name
        if not link.exists():
            link.symlink_to(entry)
    path = tmp_path / "recorded.world"
    path.write_text(text)
    return load_world(path)


def _ranges(world: World, poses: dict[int, list[float]], robot: int, ranger: int) -> np.ndarray:
    """The readings of one ranger with the robots at x, y, yaw_deg."""
    robots = dict(enumerate(world.robots))
    for index, (x, y, yaw_deg) in poses.items():
        robots[index] = msgspec.structs.replace(robots[index], pose=Pose2(x, y, math.radians(yaw_deg)))
    return Engine(world, robots=robots).observe().robots[robot].readings[ranger].ranges


@pytest.mark.parametrize("name", ["willow", "cave"])
def test_scans_are_exact_and_agree_with_stage(name: str, golden: Any, shared: Path, tmp_path: Path) -> None:
    """99.9 % of the rays lie within 1 mm of the exact caster, and Stage agrees as often as it does with that one."""
    recorded = next(w for w in golden("stage_scans.json.gz")["worlds"] if w["name"] == name)
    world = _load(tmp_path, recorded["world"], shared / recorded["bitmap_dir"])
    for kind in ("urg", "sick"):
        scans = [s for s in recorded["scans"] if s["ranger"] == kind]
        robot, ranger = _find_ranger(world, len(scans[0]["ranges"]))
        ours = np.array([_ranges(world, {robot: s["pose"]}, robot, ranger) for s in scans])
        exact = np.array([s["exact"] for s in scans])
        stage = np.array([s["ranges"] for s in scans])
        agreement = recorded["agreement"][kind]
        assert np.mean(np.abs(ours - exact) <= 1e-3) >= 0.999
        assert np.mean(np.abs(ours - stage) <= 0.05) >= agreement["within_0_05"] - 0.01
        assert np.mean(np.abs(ours - stage) <= 0.1) >= agreement["within_0_1"] - 0.01


def _find_ranger(world: World, samples: int) -> tuple[int, int]:
    for i, robot in enumerate(world.robots):
        for j, ranger in enumerate(robot.rangers):
            if ranger.samples == samples:
                return i, j
    raise AssertionError(f"no ranger with {samples} samples")


def test_heights_decide_what_a_laser_sees(golden: Any, shared: Path, tmp_path: Path) -> None:
    """In every recorded scene a laser hits other robots and boxes exactly where Stage's does."""
    scenes = golden("stage_scenes.json.gz")["scenes"]
    within, rays = 0, 0
    for number, scene in enumerate(scenes):
        folder = tmp_path / str(number)
        folder.mkdir()
        world = _load(folder, scene["world"], shared / "worlds" / "stage_ros")
        observation = Engine(world).observe()
        by_name = {robot.name: i for i, robot in enumerate(world.robots)}
        for scan in scene["scans"]:
            if "inclusive_boundary" in scene.get("tags", []):
                continue
            i = by_name[scan["robot"]]
            ours = observation.robots[i].readings[0].ranges
            limit = world.robots[i].rangers[0].range_max
            stage = np.array(scan["ranges"])
            assert (ours < limit).any() == (stage < limit).any(), (scene["name"], scan["robot"])
            within += int(np.sum(np.abs(ours - stage) <= 0.05))
            rays += len(ours)
    assert within / rays >= 0.98


def test_free_motion_follows_the_exact_arc(golden: Any, shared: Path, tmp_path: Path) -> None:
    """A robot in free space drives exact arcs, which is as far from Stage's Euler steps as was recorded."""
    for number, run in enumerate(golden("stage_motion.json.gz")["free"]):
        folder = tmp_path / str(number)
        folder.mkdir()
        engine = Engine(_load(folder, run["world"], shared / "worlds" / "stage_ros"))
        expected = engine.truth(0)
        for v, vy, w in run["commands"]:
            engine.step({0: Twist(Vector3(v, vy), Vector3(0.0, 0.0, w))})
            expected = _arc(expected, v, vy if run["drive"] == "omni" else 0.0, w)
        assert engine.truth(0)[:2] == pytest.approx(expected[:2], abs=1e-9), run["name"]
        ours, stage = engine.truth(0), run["trace"][-1]["pose"]
        assert math.dist(ours[:2], stage[:2]) <= run["compare"]["arc_max_dist"] + 1e-3


def _arc(pose: Pose2, v: float, vy: float, w: float) -> Pose2:
    """0.1 s at constant velocity, within Stage's default limits."""
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


def test_stages_own_steps_are_reproduced(golden: Any, shared: Path, tmp_path: Path) -> None:
    """With `physics="stage"` every pose of every recorded free run is Stage's to 1e-8, at every tick."""
    for number, run in enumerate(golden("stage_motion.json.gz")["free"]):
        folder = tmp_path / str(number)
        folder.mkdir()
        world = _load(folder, run["world"], shared / "worlds" / "stage_ros")
        engine = Engine(world, options=Options(physics="stage"))
        for command, recorded in zip(run["commands"], run["trace"][1:], strict=True):
            truth = engine.step({0: _twist(command)}).robots[0].truth
            x, y, yaw = recorded["pose"]
            assert truth[:2] == pytest.approx((x, y), abs=1e-8), run["name"]
            assert abs(math.remainder(truth.yaw - yaw, math.tau)) < 1e-8, run["name"]


@pytest.mark.parametrize("physics", ["stage", "kinematic"])
def test_collisions_refuse_the_move_as_stage_does(physics: str, golden: Any, shared: Path, tmp_path: Path) -> None:
    """Stalls come at Stage's tick and place, within its raster; nobody slides along a wall, and reversing frees."""
    for number, run in enumerate(golden("stage_motion.json.gz")["collisions"]):
        folder = tmp_path / str(number)
        folder.mkdir()
        world = _load(folder, run["world"], shared / "worlds" / "stage_ros")
        ids = {robot.name: i for i, robot in enumerate(world.robots)}
        engine = Engine(world, options=Options(physics=physics))  # type: ignore[arg-type]
        traces: dict[str, list[Any]] = {name: [] for name in ids}
        for commands in run["commands"]:
            seen = engine.step({ids[name]: _twist(command) for name, command in commands.items()})
            for name, i in ids.items():
                traces[name].append(seen.robots[i])
        if "first_stall_tick" in run:
            _check_stall(run, traces["a"])
        else:
            _check_meeting(run, traces)


def _check_stall(run: Any, trace: list[Any]) -> None:
    stalls = [k + 1 for k, seen in enumerate(trace) if seen.stall]
    recorded = [k for k, seen in enumerate(run["trace"]["a"]) if seen["stall"]]
    slack = 1 if "spin" in run["name"] else 2
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

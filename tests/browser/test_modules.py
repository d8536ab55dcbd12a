"""The page's pure modules, in the browser: against the server's own frames, and against the keys of teleop."""

import itertools
import json
import math
import random
from typing import Any

import numpy as np
import pytest

from support.browser import Screen
from zteam.geometry import Pose2
from zteam.robot.teleop import DIRECTIONS, MAX_SPEED, MIN_SPEED, SPEED_FACTORS
from zteam.view import frames

ARROWS = {"up": "ArrowUp", "down": "ArrowDown", "left": "ArrowLeft", "right": "ArrowRight"}


DECODED = """async (data) => {
  const {decodeFrame, unpack} = await import('/page/js/wire.js');
  const frame = decodeFrame(Uint8Array.from(data).buffer);
  for (const block of frame.blocks) {
    if (block.packed) block.cells = [...await unpack(block.packed)];
    for (const [name, value] of Object.entries(block)) if (ArrayBuffer.isView(value)) block[name] = [...value];
  }
  return frame;
}"""

FUZZED = """async (frames) => {
  const {decodeFrame, WireError} = await import('/page/js/wire.js');
  const other = [];
  for (const data of frames) {
    try {
      decodeFrame(Uint8Array.from(data).buffer);
    } catch (error) {
      if (!(error instanceof WireError)) other.push(String(error));
    }
  }
  return other;
}"""


def decode(screen: Screen, *blocks: bytes) -> Any:
    """What the page makes of a frame with these blocks."""
    found = screen.ask(DECODED, list(frames.encode_frame(4_000_000_000, 2**40, 12.5, 0.025, blocks)))
    assert (found["number"], found["tick"], found["stamp"], found["age"]) == (4_000_000_000, 2**40, 12.5, 0.025)
    return found["blocks"]


def test_poses_are_read_as_the_server_wrote_them(modules: Screen) -> None:
    """Ids, places to half a centimetre, headings, and whether they are ground truth; odd numbers of robots too."""
    poses = {0: Pose2(-3.204, 8.0, 0.5), 7: Pose2(100.0, -2.5, -3.1), 999: Pose2(0.0, 0.0, 3.1415)}
    for truth in (False, True):
        [block] = decode(modules, frames.encode_poses(poses, truth=truth))
        assert (block["type"], block["ids"], block["truth"]) == ("poses", list(poses), truth)
        found = zip(block["x"], block["y"], block["yaw"], strict=True)
        for (x, y, yaw), pose in zip(found, poses.values(), strict=True):
            assert (x, y) == pytest.approx((pose.x, pose.y), abs=0.0051)
            assert yaw == pytest.approx(pose.yaw, abs=1e-4)


def test_grids_paths_and_samples_are_read_as_the_server_wrote_them(modules: Screen) -> None:
    """Cells below zero, points behind a text of any length, and numbers of double precision."""
    cells = np.array([[-1, 0, 100], [50, -1, 1]], dtype=np.int8)
    meta = {
        "key": "map",
        "width": 3,
        "height": 2,
        "resolution": 0.05,
        "x": -1.0,
        "y": 2.0,
        "yaw": 0.0,
        "tile": [0, 0, 3, 2],
        "version": 1,
    }
    points = np.array([[0.5, 1.5], [-2.25, 3.0]])
    pairs = np.array([[1.1, 2.2], [1e9 + 0.125, -3.3]])
    for key in ("robot_1/plan", "robot_10/plan", "plan", "a"):
        grid, path, poses, samples, doc = decode(
            modules,
            frames.encode_tile(meta, cells),
            frames.encode_path(key, points),
            frames.encode_pose_array(key, np.array([[1.0, 2.0, 3.0]])),
            frames.encode_samples(key, "twist.twist.linear.x", pairs),
            frames.encode_doc("team", json.dumps({"namespace": "größe"}).encode()),
        )
        assert (grid["meta"], grid["cells"]) == (meta, cells.ravel().tolist())
        assert (path["key"], path["points"]) == (key, points.ravel().tolist())
        assert (poses["key"], poses["poses"]) == (key, [1.0, 2.0, 3.0])
        assert (samples["topic"], samples["field"]) == (key, "twist.twist.linear.x")
        assert (samples["times"], samples["values"]) == (pairs[:, 0].tolist(), pairs[:, 1].tolist())
        assert (doc["name"], doc["value"]) == ("team", {"namespace": "größe"})


def test_broken_frames_end_in_one_kind_of_error(modules: Screen) -> None:
    """Thousands of frames with changed, lost or added bytes are decoded or refused; nothing else happens."""
    blocks = [
        frames.encode_poses({i: Pose2(i, -i, 0.1 * i) for i in range(5)}),
        frames.encode_doc("log", b"[]"),
        frames.encode_path("robot_0/plan", np.zeros((3, 2))),
        frames.encode_samples("robot_0/odom", "twist", np.zeros((2, 2))),
    ]
    whole, chance = frames.encode_frame(1, 2, 3.0, 0.0, blocks), random.Random(1)

    def broken() -> list[int]:
        data = bytearray(whole)
        for _ in range(chance.randrange(1, 4)):
            data[chance.randrange(len(data))] = chance.randrange(256)
        return [*data[: chance.choice([len(data), chance.randrange(len(data))])], *range(chance.randrange(3))]

    assert modules.ask(FUZZED, [broken() for _ in range(3000)]) == []


def test_the_camera_inverts_itself(modules: Screen) -> None:
    """A place of the map comes back from its pixel, a zoom keeps the place under the mouse; the matrix agrees."""
    found = modules.ask("""async () => {
      const {Camera} = await import('/page/js/scene/camera.js');
      const worst = {back: 0, zoom: 0, matrix: 0};
      for (let i = 0; i < 500; i++) {
        const camera = new Camera(() => {}), random = (range) => (Math.random() - 0.5) * range;
        camera.resize(300 + Math.random() * 2000, 200 + Math.random() * 1000);
        camera.set({x: random(100), y: random(100), scale: 2 + Math.random() * 300, angle: random(7)});
        const [px, py] = [Math.random() * camera.width, Math.random() * camera.height], [x, y] = camera.toMap(px, py);
        const [backX, backY] = camera.toScreen(x, y);
        worst.back = Math.max(worst.back, Math.hypot(backX - px, backY - py));
        const m = camera.matrix(), cx = m[0] * x + m[3] * y + m[6], cy = m[1] * x + m[4] * y + m[7];
        const glX = (cx + 1) / 2 * camera.width, glY = (1 - cy) / 2 * camera.height;
        worst.matrix = Math.max(worst.matrix, Math.hypot(glX - px, glY - py));
        camera.zoom(px, py, 0.5 + Math.random(), random(1));
        const [zoomX, zoomY] = camera.toScreen(x, y);
        worst.zoom = Math.max(worst.zoom, Math.hypot(zoomX - px, zoomY - py));
      }
      return worst;
    }""")
    assert found["back"] < 1e-6
    assert found["zoom"] < 1e-6
    assert found["matrix"] < 0.05, "WebGL's numbers have 24 bits"


WAYS = """async ([steps, looks]) => {
  const { PoseTable } = await import('/page/js/poses.js'), table = new PoseTable(), found = [];
  for (const [stamp, now, robots] of steps) {
    const block = { type: 'poses', truth: false, ids: Uint16Array.from(robots, (robot) => robot[0]) };
    ['x', 'y', 'yaw'].forEach((name, i) => (block[name] = Float32Array.from(robots, (robot) => robot[i + 1])));
    table.take(block, stamp, now);
    found.push(looks.map((look) => {
      const goesOn = table.drawAt(now + look);
      return [goesOn, ...robots.map(([id]) => Object.values(table.drawn(id)))];
    }));
  }
  return found;
}"""
"""Where robots are drawn so many ms after each step of (s, ms, robots with id, x, y, yaw)."""


def ways(modules: Screen, looks: list[float], *steps: list[Any]) -> Any:
    """Per step and look: whether more pictures are needed, and where each robot is drawn."""
    return modules.ask(WAYS, [steps, looks])


def test_a_robot_is_drawn_between_its_last_two_poses(modules: Screen) -> None:
    """It is never more than one period late, turns the shorter way, and goes on from where it was drawn last."""
    first, then = [7, 1.0, 2.0, 3.1], [7, 1.1, 2.0, -3.1]
    begin, after = ways(modules, [0, 25, 50, 100, 900], [5.0, 1000, [first]], [5.1, 1100, [then]])
    assert [step[0] for step in begin] == [False] * 5
    assert begin[0][1] == pytest.approx(first[1:], abs=1e-6)
    turn = 2 * math.pi - 6.2
    assert [step[0] for step in after] == [True, True, True, False, False]
    for share, step in zip((0.0, 0.25, 0.5, 1.0, 1.0), after, strict=True):
        assert step[1] == pytest.approx([1.0 + 0.1 * share, 2.0, -3.1 - (1 - share) * turn], abs=1e-5)
    early = [[5.0 + i / 10, 1000 + 90 * i, [[7, i / 10, 0.0, 0.0]]] for i in range(4)]
    ends = [step[-1][1][0] for step in ways(modules, [89.9], *early)]
    starts = [step[0][1][0] for step in ways(modules, [0, 89.9], *early)]
    assert starts[1:] == pytest.approx(ends[:-1], abs=1e-3)


def test_jumps_are_not_drawn_as_ways(modules: Screen) -> None:
    """A robot that was reset, moved far, or moved while time stands is at its new pose at once; the others go on."""
    a, b = [1, 0.0, 0.0, 0.0], [2, 5.0, 0.0, 0.0]
    steps = [
        [9.0, 1000, [a, b]],
        [9.1, 1100, [[1, 0.1, 0.0, 0.0], [2, 8.0, 0.0, 0.0]]],
        [9.1, 1120, [[1, 0.1, 0.0, 0.0], [2, 8.1, 0.0, 0.0]]],
        [0.1, 1200, [a, b]],
        [0.2, 1300, [[2, 5.1, 0.0, 0.0], [1, 0.1, 0.0, 0.0], [3, 0.1, 0.0, 0.0]]],
    ]
    _, far, standing, reset, more = ways(modules, [0], *steps)
    assert [pose[0] for pose in far[0][1:]] == pytest.approx([0.0, 8.0])
    assert [pose[0] for pose in standing[0][1:]] == pytest.approx([0.02, 8.1], abs=1e-5)
    assert [pose[0] for pose in reset[0][1:]] == [0.0, 5.0]
    assert [pose[0] for pose in more[0][1:]] == pytest.approx([5.0, 0.0, 0.1], abs=1e-5)


NAMES = """async ([spacing, textSize]) => {
  const [{ placeNames }, { Camera }, { Store }] = await Promise.all(
    ['scene/labels.js', 'scene/camera.js', 'store.js'].map((name) => import(`/page/js/${name}`)));
  const store = new Store(), camera = new Camera(() => {}), ids = Uint16Array.from({ length: 36 }, (_, i) => i);
  camera.resize(1280, 800);
  camera.set({ x: 0, y: 0, scale: 60 });
  const x = Float32Array.from(ids, (i) => spacing * ((i % 6) - 2.5));
  const y = Float32Array.from(ids, (i) => spacing * (Math.floor(i / 6) - 2.5));
  store.poses.take({ type: 'poses', truth: false, ids, x, y, yaw: new Float32Array(36) }, 1, 0);
  const app = { store, camera, layers: new Set(['labels']) };
  const theme = { textSize, css: { text: '#000', halo: '#fff' } };
  const pen = { app, theme, ratio: 1, radius: () => 0.2, reach: () => 12, names: [], taken: [] };
  return placeNames(pen).map(({ robot, leader }, i) => {
    return { box: pen.taken[i], leader, at: camera.toScreen(x[robot], y[robot]) };
  });
}"""


def test_names_touch_their_robots_or_have_a_line_to_them(modules: Screen) -> None:
    """In a crowd no two names overlap, also with large text, and a name that finds no room at its robot is near, with a
    line to its edge."""

    def distance(box: list[float], at: list[float]) -> float:
        return math.hypot(max(box[0] - at[0], 0, at[0] - box[2]), max(box[1] - at[1], 0, at[1] - box[3]))

    crowded, apart, large = (modules.ask(NAMES, case) for case in ([0.7, 1], [1.8, 1], [1.8, 2]))
    assert len(apart) == len(crowded) == 36
    assert not any(name["leader"] for name in apart)
    assert 3 < sum(name["leader"] is not None for name in crowded) < 33
    assert {name["box"][3] - name["box"][1] for name in large} == {32}
    for name in [*apart, *crowded, *large]:
        if (leader := name["leader"]) is None:
            assert distance(name["box"], name["at"]) == pytest.approx(12.0, abs=0.5)
        else:
            assert math.dist(leader[:2], name["at"]) == pytest.approx(12.0, abs=0.5)
            assert distance(name["box"], leader[2:]) == pytest.approx(0.0, abs=0.5)
            assert distance(name["box"], name["at"]) < 100
    # Places are taken in steps of four pixels.
    for names in (crowded, large):
        for a, b in itertools.combinations([name["box"] for name in names], 2):
            across, down = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
            assert across <= 4 or down <= 4


def test_fit_shows_the_whole_box(modules: Screen) -> None:
    """At any angle all corners of the box are on the screen, and it fills at least one direction."""
    found = modules.ask("""async () => {
      const {Camera} = await import('/page/js/scene/camera.js');
      const camera = new Camera(() => {}), spans = [];
      camera.resize(800, 500);
      for (const angle of [0, 0.4, 1.57, 3]) {
        camera.set({angle});
        camera.fit([-3, -1, 9, 4], 10);
        const corners = [[-3, -1], [9, -1], [-3, 4], [9, 4]].map(([x, y]) => camera.toScreen(x, y));
        const xs = corners.map((c) => c[0]), ys = corners.map((c) => c[1]);
        spans.push([Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)]);
      }
      return spans;
    }""")
    for left, right, top, bottom in found:
        assert min(left, top) >= 9.9
        assert right <= 790.1
        assert bottom <= 490.1
        assert right - left > 779 or bottom - top > 479


def test_keys_are_those_of_teleop(modules: Screen) -> None:
    """Each key of the terminal's teleop means the same on the page, alone; speeds have the same factors and bounds."""
    directions = {ARROWS.get(key, key): list(direction) for key, direction in DIRECTIONS.items()}
    ask = """async ([keys, factors]) => {
      const law = await import('/page/js/drive/law.js');
      const shares = {}, limits = {};
      for (const key of keys) {
        const {linear, left, angular} = law.sharesOfKeys([key]);
        shares[key] = [linear, left, angular];
      }
      for (const key of factors) {
        const {speed, turn} = law.scaled({speed: 1, turn: 1}, key);
        limits[key] = [speed, turn];
      }
      return [shares, limits, [law.MIN_SPEED, law.MAX_SPEED], keys.every(law.isDirection)];
    }"""
    shares, limits, bounds, known = modules.ask(ask, [list(directions), list(SPEED_FACTORS)])
    assert known
    assert shares == directions
    assert {key: tuple(pair) for key, pair in limits.items()} == SPEED_FACTORS
    assert bounds == [MIN_SPEED, MAX_SPEED]


def test_held_keys_add_up_and_sticks_have_a_dead_zone(modules: Screen) -> None:
    """Up and left make an arc, opposite keys stand; a stick stands near its middle, and is full at its rim."""
    ask = """async () => {
      const {sharesOfKeys, sharesOfStick} = await import('/page/js/drive/law.js');
      return [['ArrowUp', 'ArrowLeft'], ['i', ','], ['u', 'ArrowUp']].map(sharesOfKeys)
        .concat([[0.05, 0.05], [0, -1], [1, 0], [0.7, 0.7]].map(([x, y]) => sharesOfStick(x, y)))
        .map(({linear, left, angular}) => [linear, left, angular]);
    }"""
    arc, stand, most, middle, up, right, back = modules.ask(ask)
    assert (arc, stand, most) == ([1, 0, 1], [0, 0, 0], [1, 0, 1])
    assert middle == [0, 0, 0]
    assert up == pytest.approx([1, 0, 0])
    assert right == pytest.approx([0, 0, -1])
    assert back[0] < -0.6
    assert back[2] > 0.6, "backwards to the right turns as a car does"


def test_frames_are_composed_up_to_the_map(modules: Screen) -> None:
    """A frame's pose in map follows from its parents; loops and trees without the map are left out."""
    frames_of = [
        {"name": "base", "parent": "odom", "x": 1, "y": 0, "yaw": 0},
        {"name": "odom", "parent": "map", "x": 2, "y": 3, "yaw": math.pi / 2},
        {"name": "a", "parent": "b", "x": 0, "y": 0, "yaw": 0},
        {"name": "b", "parent": "a", "x": 0, "y": 0, "yaw": 0},
        {"name": "far", "parent": "elsewhere", "x": 0, "y": 0, "yaw": 0},
    ]
    ask = "async (list) => Object.fromEntries((await import('/page/js/scene/frames.js')).composeFrames(list))"
    found = modules.ask(ask, frames_of)
    assert set(found) == {"map", "odom", "base"}
    assert (found["base"]["x"], found["base"]["y"]) == pytest.approx((2, 4))


def test_outlines_are_filled_whole(modules: Screen) -> None:
    """The triangles of convex and hollow outlines, either way round, cover the outline's area."""
    angle = [[0, 0], [4, 0], [4, 1], [1, 1], [1, 3], [0, 3]]
    square, star = [[0, 0], [1, 0], [1, 1], [0, 1]], []
    for i in range(10):
        radius = 2 if i % 2 else 0.7
        star.append([radius * math.cos(i * math.pi / 5), radius * math.sin(i * math.pi / 5)])
    ask = """async (polygon) => {
      const c = (await import('/page/js/scene/polygons.js')).triangulate(polygon);
      let area = 0;
      for (let i = 0; i < c.length; i += 6) {
        const [ax, ay, bx, by, cx, cy] = c.slice(i, i + 6);
        area += Math.abs((bx - ax) * (cy - ay) - (cx - ax) * (by - ay)) / 2;
      }
      return area;
    }"""
    for polygon in (square, angle, star):
        xs, ys = np.array(polygon).T
        area = abs(np.dot(xs, np.roll(ys, -1)) - np.dot(ys, np.roll(xs, -1))) / 2
        for way in (polygon, polygon[::-1]):
            assert modules.ask(ask, way) == pytest.approx(area)


def test_robots_have_colours_that_differ(modules: Screen) -> None:
    """In both themes 24 robots have 24 colours, and the one after another differ clearly."""
    ask = """async (dark) => {
      const {rgbOf, robotColor} = await import('/page/js/robot_colors.js');
      return [...Array(24).keys()].map((id) => rgbOf(robotColor(id, dark)));
    }"""
    for dark in (False, True):
        colors = [tuple(color) for color in modules.ask(ask, dark)]
        assert len(set(colors)) == 24
        assert all(math.dist(a, b) > 0.25 for a, b in itertools.pairwise(colors))


def test_nothing_of_a_removed_robot_stays(modules: Screen) -> None:
    """Its plan goes and the map hears of it; a tile that was under way goes with the next team document."""
    assert modules.ask("""async () => {
      const { Store } = await import('/page/js/store.js'), store = new Store(), heard = [];
      const team = (...ids) => store.takeFrame({ number: 0, tick: 0, stamp: 0, age: 0, blocks: [
        { type: 'doc', name: 'team', value: { robots: ids.map((id) => ({ id })), outlines: [] } }] }, 0);
      for (const name of ['paths', 'grids']) store.on(name, (key) => heard.push(key));
      team(0, 1);
      for (const id of [0, 1]) store.paths.set(`robot_${id}/plan`, new Float32Array(2));
      team(0);
      store.grids.set('robot_1/global_costmap/costmap', new Map());
      team(0);
      return [[...store.paths.keys()], store.grids.size, heard];
    }""") == [["robot_0/plan"], 0, ["robot_1/plan", "robot_1/global_costmap/costmap"]]


def test_a_place_whose_tile_has_not_come_is_unknown(modules: Screen) -> None:
    """It is not called outside: on a slow link a map comes tile by tile."""
    assert modules.ask("""async () => {
      const { judge } = await import('/page/js/costs.js');
      const meta = { x: 0, y: 0, yaw: 0, resolution: 1, width: 4, height: 2, tile: [0, 0, 2, 2] };
      const grids = new Map([['map', new Map([['0,0', { meta, cells: new Int8Array(4) }]])]]);
      return [1.5, 3.5, 4.5].map((x) => judge({ grids, robots: new Map() }, [], x, 1.5).text);
    }""") == ["free", "unknown", "outside the map"]


def test_poses_count_as_drawn_whatever_comes_after_them(modules: Screen) -> None:
    """A frame with scans alone, which comes before the drawing, does not hide that its robots are new."""
    assert modules.ask("""async () => {
      const [{ App }, { makeScene }] = await Promise.all(
        ['app.js', 'scene/scene.js'].map((name) => import(`/page/js/${name}`)));
      const app = new App(), element = document.body.appendChild(document.createElement('div'));
      element.innerHTML = '<div id="map"></div>';
      element.style.height = '100px';
      const stats = { frames: 0, js_ms: [], arrival_ms: [], age_ms: [], bytes: 0 };
      const scene = makeScene(app, element, stats);
      const [x, y, yaw] = [new Float32Array(1), new Float32Array(1), new Float32Array(1)];
      const poses = { type: 'poses', truth: false, ids: new Uint16Array([0]), x, y, yaw };
      app.store.takeFrame({ number: 1, tick: 1, stamp: 1, age: 0.02, blocks: [poses] }, performance.now());
      app.store.takeFrame({ number: 2, tick: 1, stamp: 1, age: -1, blocks: [] }, performance.now());
      for (const drawn of [stats.frames + 1, stats.frames + 2]) {
        for (scene.requestDraw(); stats.frames < drawn;) await new Promise(requestAnimationFrame);
      }
      element.remove();
      return stats.arrival_ms;
    }""") == [20]


def test_a_press_meets_a_robot_where_it_is_drawn(modules: Screen) -> None:
    """On its way to its newest pose, not there."""
    assert modules.ask("""async () => {
      const [{ robotAt }, { Camera }, { Store }] = await Promise.all(
        ['tools/pointer.js', 'scene/camera.js', 'store.js'].map((name) => import(`/page/js/${name}`)));
      const store = new Store(), camera = new Camera(() => {}), none = new Float32Array(1);
      camera.resize(800, 800);
      for (const [stamp, x] of [[1, 0], [2, 2]]) {
        const block = { truth: false, ids: new Uint16Array([7]), x: new Float32Array([x]), y: none, yaw: none };
        store.poses.take(block, stamp, 1000 * stamp);
      }
      store.poses.drawAt(2000);
      return [0, 2].map((x) => robotAt({ store, camera, scene: null }, ...camera.toScreen(x, 0)));
    }""") == [7, -1]

"""The next frame of one page: what it looks at and does not have yet."""

import re
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam import names
from zteam.clock import monotonic, to_seconds
from zteam.geometry import Pose2
from zteam.messages import LaserScan, Message, Path, Pose, PoseArray
from zteam.messages.planar import pose2_of
from zteam.node.tick_messages import stamp_of
from zteam.view import frames
from zteam.view.documents import Documents
from zteam.view.received import Received, Viewer, robots_in_sight
from zteam.view.scene import Scene
from zteam.view.team_view import TeamView

TEAM_AGAIN, TEAM_SIZE = 1.0, 250
"""Host seconds after which `team` is sent again without a change but of ages and speeds, and the robots up to which it
holds. For more it is longer: a page takes milliseconds to read a thousand rows."""
SLOW, OFTEN, FAST = 1.0, 0.5, 0.1
"""Host seconds between two documents: of those in lists, of one robot, and of those that are drawn."""
FRAME_BYTES = 32_000
"""Size from which on a frame takes no further tile; the next frame takes them. At 50 kB/s it takes 0.6 s."""
LINES = 200
"""Of logs that go into one frame."""


Encode = Callable[[str, NDArray[np.float64]], bytes]


class Composer:
    """Makes frames for all pages, on one thread."""

    def __init__(self, state: TeamView) -> None:
        self._state = state
        self._scene, self._documents = Scene(state), Documents(state)

    def compose(self, viewer: Viewer) -> bytes | None:
        """The next frame; None if there is nothing new."""
        state, now = self._state, monotonic()
        number, poses = self._scene.poses()
        if viewer.era != state.places.eras:
            viewer.forget(state.places.eras)
        has_poses = bool(number) and viewer.lacks("poses", number)
        blocks = [poses] if has_poses else []
        blocks += self._scans(viewer)
        blocks += self._navigation(viewer)
        blocks += self._docs(viewer, now)
        blocks += self._watched(viewer, now)
        blocks += self._grids(viewer, FRAME_BYTES - sum(map(len, blocks)))
        if not blocks:
            return None
        places, sim = state.places, state.queries.sim
        tick = places.stamp // sim.interval if sim and sim.interval > 0 else 0
        sent = monotonic()
        age = sent - places.time if has_poses and places.time else -1.0
        return frames.encode_frame(viewer.next_frame(sent), tick, to_seconds(places.stamp), age, blocks)

    def _scans(self, viewer: Viewer) -> Iterator[bytes]:
        robots = robots_in_sight(viewer, self._state.poses) if "scans" in viewer.look.layers else []
        before, viewer.scans = viewer.scans, {}
        for robot_id in robots:
            for index, number, block in self._scene.scans(robot_id, viewer.look.beams):
                viewer.scans[robot_id, index] = version = number, viewer.look.beams
                if before.pop((robot_id, index), None) != version:
                    yield block
        # What is not sent any more must not stay on the map as if it were seen now.
        for robot_id, index in before:
            yield frames.encode_scan(robot_id, index, LaserScan(), Pose2(0.0, 0.0, 0.0), beams=1)

    def _grids(self, viewer: Viewer, room: int) -> list[bytes]:
        """Tiles that the page lacks, of so many bytes together, and at least one."""
        found: list[bytes] = []
        costmaps = self._state.drawables.of("costmaps") if "costmaps" in viewer.look.layers else []
        if "costs" in viewer.look.layers:
            costmaps += [names.robot_key(i, names.GLOBAL_COSTMAP) for i in viewer.look.selected]
        keys = list(dict.fromkeys((names.MAP, *costmaps)))
        # After the one that was cut: else the last ones would never have room on a slow link.
        first = keys.index(viewer.cut) + 1 if viewer.cut in keys else 0
        viewer.cut = ""
        for key in keys[first:] + keys[:first]:
            for tile in self._scene.grid(key):
                if viewer.has.get((key, tile.place)) == tile.version:
                    continue
                if found and room < len(tile.block):
                    viewer.cut = key
                    return found
                viewer.has[key, tile.place] = tile.version
                found.append(tile.block)
                room -= len(tile.block)
        return found

    def _navigation(self, viewer: Viewer) -> Iterator[bytes]:
        """Paths and particles."""
        drawables, read, pose_of = self._state.drawables, self._state.received.read, self._state.places.pose_of
        kinds: tuple[tuple[str, type[Path | PoseArray], Encode], ...] = (
            ("plans", Path, frames.encode_path), ("particles", PoseArray, frames.encode_pose_array),
        )  # fmt: skip
        for layer, kind, encode in kinds:
            for key in drawables.of(layer) if layer in viewer.look.layers else ():
                found = read(key, kind)
                frame = pose_of(found[1].header.frame_id) if found else None
                if found and frame is not None and viewer.lacks(key, found[0].number):
                    poses = [pose if isinstance(pose, Pose) else pose.pose for pose in found[1].poses]
                    numbers = [frame.compose(pose2_of(pose)) for pose in poses]
                    yield encode(key, np.array(numbers, np.float64).reshape(-1, 3))

    def _docs(self, viewer: Viewer, now: float) -> Iterator[bytes]:
        team, version = self._scene.team()
        again = TEAM_AGAIN * max(1.0, len(self._state.poses) / TEAM_SIZE)
        if viewer.lacks("team", version) | viewer.lacks("team again", int(now / again)):
            yield frames.encode_doc("team", team)
        layers, docs, make, robot_id = viewer.layers, viewer.look.docs, self._documents, viewer.inspected
        # What has not come yet is not sent as an empty list: the page tells the two apart.
        has_frames, topics = make.knows_frames, self._state.queries.topics
        rows: list[tuple[str, bool, float, Callable[[], bytes]]] = [
            ("tf", has_frames and ("tf" in layers or "tf" in docs), FAST if "tf" in layers else SLOW, make.transforms),
            ("topics", topics is not None and "topics" in docs, SLOW, lambda: msgspec.json.encode(topics)),
            ("inspect", robot_id is not None, OFTEN, partial(make.inspect, robot_id or 0)),
            ("replay", True, FAST, lambda: msgspec.json.encode(self._state.queries.replay)),
            ("doctor", "doctor" in docs, FAST, lambda: self._state.diagnosis.document),
            *((name, name in layers, FAST, drawn) for name, drawn in make.drawn.items()),
        ]
        for name, is_shown, period, document_of in rows:
            # Of those that were not looked at within their period, those that have changed.
            if is_shown and viewer.lacks((name, "looked at"), int(now / period)):
                document = document_of()
                if viewer.lacks((name, "sent"), zlib.crc32(document)):
                    yield frames.encode_doc(name, document)
        if "log" in docs:
            viewer.log_number, lines = make.log(viewer.log_number)
            if lines or (self._state.queries.kept_log is not None and viewer.lacks("log", "begun")):
                yield frames.encode_doc("log", msgspec.json.encode(lines[-LINES:]))

    def _watched(self, viewer: Viewer, now: float) -> Iterator[bytes]:
        offset = to_seconds(self._state.places.stamp) - now
        for (topic, field), number in list(viewer.watches.items()):
            if field:
                newest, pairs = samples_since(self._state.received, topic, field, number, offset)
                viewer.watches[topic, field] = newest
                if len(pairs):
                    yield frames.encode_samples(topic, field, pairs)
            elif viewer.lacks((topic, "looked at"), int(now / FAST)):
                arrival = self._state.received.get(topic)
                if arrival is not None and arrival.number != number:
                    viewer.watches[topic, field] = arrival.number
                    yield frames.encode_doc("echo", self._documents.echo(arrival))


_STEP = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)((?:\[[0-9]{1,6}\])*)", re.ASCII)
_LEAST = re.compile(r"min\((.+)\)")


def number_at(message: Message, field: str) -> float | None:
    """The number of a message at a path, such as `twist.twist.linear.x` or `ranges[3]`; None where there is none.

    With `min(ranges)` it is the least of a list; of a scan's ranges the least that is a distance.
    """
    least = _LEAST.fullmatch(field)
    value: Any = message
    try:
        for part in (least[1] if least else field).split("."):
            step = _STEP.fullmatch(part)
            if step is None or not isinstance(value, Message) or step[1] not in value.__struct_fields__:
                return None
            value = getattr(value, step[1])
            for index in re.findall(r"[0-9]+", step[2]):
                value = value[int(index)]
        if not least:
            return None if isinstance(value, Message | str | bytes | list) else float(value)
        values = np.asarray(value, np.float64).ravel()
    except (IndexError, TypeError, KeyError, ValueError):
        return None
    lowest, highest = (message.range_min, message.range_max) if isinstance(message, LaserScan) else (-np.inf, np.inf)
    values = values[np.isfinite(values) & (values >= lowest) & (values < highest)]
    return float(values.min()) if values.size else None


MOST = 100
"""Samples of one field in a frame; of more, evenly spaced ones are taken."""


def samples_since(
    received: Received, topic: str, field: str, number: int, team_from_host: float
) -> tuple[int, NDArray[np.float64]]:
    """The number of the newest message, and pairs (n, 2) of time in s and value of those after `number`.

    The time is that of the message's header. For a type without one it is the host's time at which the message came,
    with `team_from_host` (s) added.
    """
    events = received.since(topic, number)
    if not events:
        return number, np.zeros((0, 2))
    pairs = []
    for event in events[:: -max(1, -(-len(events) // MOST))][::-1]:
        message = event.read(event.kind) if event.kind else None
        value = None if message is None else number_at(message, field)
        if message is not None and value is not None:
            pairs.append((to_seconds(stamp_of(message)) or event.time + team_from_host, value))
    return events[-1].number, np.array(pairs, np.float64).reshape(-1, 2)

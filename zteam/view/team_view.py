"""Where pages and bus meet: what the pages look at, what has come, and where the robots are."""

import threading
from collections.abc import Callable, Iterable

from zteam import names
from zteam.geometry import Pose2, yaw_from_quaternion
from zteam.messages import Odometry, Pose, TFMessage, ns_from_time
from zteam.messages.tf_stamps import bases_stamp
from zteam.node.process_node import ProcessNode
from zteam.transforms import Buffer, TransformException
from zteam.view.queries import ASK_PERIOD, TeamQueries
from zteam.view.received import (
    FAST_PERIOD,
    PERIOD,
    Drawables,
    Received,
    Subscriptions,
    Viewer,
    scanned_robots,
    topics_of,
)


class Places:
    """Reads what has come since the last look. One thread makes all calls."""

    def __init__(self, received: Received) -> None:
        self._received = received
        self.buffer = Buffer()
        self._taken = 0
        """The number of the newest bundle that was taken."""
        self._taken_static = 0
        self.stamp = 0
        """Nanoseconds of the newest poses."""
        self.number = 0
        """Of the newest poses' message."""
        self.time = 0.0
        """Host time at which these came."""
        self.from_truth = False

    def _take_static(self) -> None:
        arrival = self._received.get(names.TF_STATIC)
        if arrival is None or arrival.number == self._taken_static:
            return
        self._taken_static = arrival.number
        message = arrival.read(TFMessage)
        if message is not None:
            self.buffer.set_all_static(message.transforms, names.TF)
            if self._taken:
                # Where odometry begins may be another place now.
                self.number = max(self.number, arrival.number)

    def look(self, robots: Iterable[int]) -> dict[int, Pose2]:
        """The pose in `map` of each of these robots whose pose is known."""
        self._take_static()
        if self._take_bundle():
            self.from_truth = False
        if not self._taken:
            return self._look_at_truth(robots)
        found = {}
        for robot_id in robots:
            pose = self.pose_of(names.robot_frame(robot_id, names.BASE_FOOTPRINT))
            if pose is not None:
                found[robot_id] = pose
        return found

    def _take_bundle(self) -> bool:
        arrival = self._received.get(names.TF)
        if arrival is None or arrival.number == self._taken:
            return False
        message = arrival.read(TFMessage)
        if message is None:
            return False
        stamp = bases_stamp(message)
        if stamp and stamp < self.stamp:
            # Time was set back: what was known of the other time does not count.
            self.buffer.clear()
        self.buffer.set_transforms(message.transforms, names.TF)
        self.stamp = stamp or self.stamp
        self._taken = self.number = arrival.number
        self.time = arrival.time
        return True

    def pose_of(self, frame: str, stamp: int = 0) -> Pose2 | None:
        """The pose of a frame in `map` at `stamp` (ns), or its newest where it is not known for then."""
        name = names.strip_slash(frame)
        if name == names.MAP_FRAME:
            return Pose2(0.0, 0.0, 0.0)
        for time in (stamp, 0) if stamp else (0,):
            try:
                return self.buffer.lookup_pose2(names.MAP_FRAME, name, time)[0]
            except TransformException:
                pass
        return None

    def _look_at_truth(self, robots: Iterable[int]) -> dict[int, Pose2]:
        found = {}
        for robot_id in robots:
            arrival = self._received.get(names.robot_key(robot_id, names.GROUND_TRUTH))
            message = arrival and arrival.read(Odometry)
            if arrival is None or message is None:
                continue
            found[robot_id] = pose2_of(message.pose.pose)
            if arrival.number > self.number:
                self.number, self.time = arrival.number, arrival.time
                self.stamp = ns_from_time(message.header.stamp)
        self.from_truth = bool(found)
        return found


def pose2_of(pose: Pose) -> Pose2:
    """The planar part of a pose."""
    turn = pose.orientation
    return Pose2(pose.position.x, pose.position.y, yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w))


LOOK = 0.2
"""Host seconds between two looks at which robots are in sight."""
FAST = 2.0
"""Simulated seconds a second of the host from which on time runs fast."""
REST = 3600.0
"""Host seconds to wait for a page at a time."""


class TeamView:
    """The main thread runs `serve`; the thread of the pages makes frames and tells of viewers."""

    def __init__(self, node: ProcessNode) -> None:
        self.node = node
        self.on_news: Callable[[], None] = lambda: None
        """Called from any thread when something came."""
        self.received = Received(lambda: self.on_news())
        self.drawables = Drawables(self.received)
        self.places = Places(self.received)
        self.queries = TeamQueries(node, self.received, lambda: self.on_news())
        self.viewers: dict[int, Viewer] = {}
        self.lease_of: Callable[[int], int | None] = lambda robot_id: None
        """The viewer that drives a robot."""
        self.poses: dict[int, Pose2] = {}
        """The robots' newest poses in `map`. Replaced as a whole."""
        self._subscriptions = Subscriptions(node.bus, self.received)
        self._looks = 0
        self._asks = 0

    @property
    def period(self) -> float:
        """Host seconds between two frames of one page."""
        return FAST_PERIOD if self._runs_fast else PERIOD

    @property
    def _runs_fast(self) -> bool:
        sim = self.queries.sim
        return sim is not None and sim.real_time_factor > FAST and not (sim.paused or sim.finished)

    def robots(self) -> set[int]:
        """All robots of which anything is known."""
        targets = [names.split_robot_key(arrival.key) for arrival in self.received.newest()]
        found = {target[0] for target in targets if target is not None} | self.queries.robots()
        return found if self.queries.sim is None else found | set(self.queries.sim.robots)

    def add(self, viewer: Viewer) -> None:
        """A page came."""
        with self.node.changed:
            self.viewers = {**self.viewers, viewer.number: viewer}
            self.changed()
            self.ask_soon()

    def remove(self, viewer: Viewer) -> None:
        """A page has gone."""
        with self.node.changed:
            self.viewers = {number: other for number, other in self.viewers.items() if other is not viewer}
            self.changed()

    def changed(self) -> None:
        """Some page looks at something else."""
        with self.node.changed:
            self._looks += 1
            self.node.changed.notify_all()

    def ask_soon(self) -> None:
        """Something may have changed that is asked for."""
        with self.node.changed:
            self._asks += 1
            self.node.changed.notify_all()

    def serve(self) -> None:
        """Subscribe to what the pages look at, until the process is asked to stop."""
        threading.Thread(target=self._ask, name="queries", daemon=True).start()
        while not self.node.stopping:
            self._match()

    def _match(self) -> None:
        looks, viewers = self._looks, self.viewers
        self.queries.watch(bool(viewers))
        self.drawables.take_keys(declaration.key for declaration in self.queries.declarations if declaration.publishes)
        aggregator, sampled = self.queries.alive(names.AGGREGATOR), self._choose_sampled()
        wanted = topics_of(viewers.values(), self.poses, self.drawables, aggregator=aggregator, sampled=sampled)
        self._subscriptions.match(wanted)
        if sampled is not None:
            self.queries.sample(sampled, transforms=aggregator)
        if not viewers:
            self.received.clear()
            self.places, self.poses = Places(self.received), {}
        period = LOOK if sampled is None else FAST_PERIOD
        self.node.wait(lambda: self._looks != looks, period if viewers else REST)

    def _choose_sampled(self) -> set[int] | None:
        """Where time runs fast a page sees one message of many, and each that comes slows the run: the robots whose
        scans are asked for instead, or None for no sampling."""
        sim, viewers = self.queries.sim, self.viewers.values()
        if sim is None or not viewers or not self._runs_fast:
            return None
        return scanned_robots(viewers, self.poses) & set(sim.robots)

    def _ask(self) -> None:
        while not self.node.stopping:
            self._ask_once()

    def _ask_once(self) -> None:
        viewers, asks = self.viewers, self._asks
        if viewers:
            layers = {layer for viewer in viewers.values() for layer in viewer.look.layers}
            docs = {name for viewer in viewers.values() for name in viewer.look.docs}
            self.queries.ask(layers, docs, self._subscriptions.opened)
        self.node.wait(lambda: self._asks != asks, ASK_PERIOD if viewers else REST)

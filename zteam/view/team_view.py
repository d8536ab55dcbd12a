"""Where pages and bus meet: what the pages look at, what has come, and where the robots are."""

import threading
from collections.abc import Callable, Collection, Iterable
from contextlib import suppress
from typing import TypeVar

from zteam import names
from zteam.geometry import FAR, Pose2
from zteam.messages import Header, LaserScan, Message, Odometry, TFMessage, Transform, TransformStamped, Vector3
from zteam.messages.geometry_msgs import bases_stamp
from zteam.messages.planar import pose2_of
from zteam.messages.std_msgs import ns_from_time
from zteam.node.process_node import ProcessNode
from zteam.transforms import Buffer, TransformException
from zteam.transforms.lasers import LaserMounts, LevelScan
from zteam.view.queries import Diagnosis, TeamQueries
from zteam.view.received import FAST_PERIOD, PERIOD, Arrival, Drawables, Received, Subscriptions, Viewer, topics_of

M = TypeVar("M", bound=Message)


def shown(pose: Pose2 | None) -> Pose2 | None:
    return pose if pose is not None and abs(pose.x) <= FAR and abs(pose.y) <= FAR else None


class Places:
    """Reads what has come since the last look. One thread makes all calls."""

    def __init__(self, received: Received) -> None:
        self._received = received
        self.buffer = Buffer()
        self._truths = Buffer()
        """Where the simulator's ground truth had each robot, in the frames of its odometry and its base."""
        self._lasers: dict[int, LaserMounts] = {}
        self._taken: dict[str, int] = {}
        """By key: the number of the newest message that was taken."""
        self.stamp = 0
        """Nanoseconds of the newest poses."""
        self.number = 0
        """Of the newest poses' message."""
        self.time = 0.0
        """Host time at which these came."""
        self.from_truth = False
        self.eras = 0
        """How often time was set back."""
        self.compared: Collection[int] = ()
        """The robots whose ground truth comes. What came before of the others tells nothing of where they are now."""
        self._compared: dict[int, tuple[Pose2, Pose2]] = {}
        """The last of `truth_of`, by robot."""

    def _take(self, key: str, kind: type[M]) -> tuple[Arrival, M] | tuple[None, None]:
        """The newest message of a key that was not taken before."""
        arrival = self._received.get(key)
        message = None if arrival is None or arrival.number == self._taken.get(key) else arrival.read(kind)
        if arrival is None or message is None:
            return None, None
        self._taken[key] = arrival.number
        return arrival, message

    def look(self, robots: Iterable[int], *, stands: bool = False) -> dict[int, Pose2]:
        """The pose in `map` of each of these robots whose pose is known. In a world that `stands` a new robot has none
        before the next tick: until then it is where its odometry begins."""
        arrival, static = self._take(names.TF_STATIC, TFMessage)
        if arrival and static:
            self.buffer.set_all_static(static.transforms, names.TF)
            if names.TF in self._taken:
                # Where odometry begins may be another place now.
                self.number = max(self.number, arrival.number)
        # Each message counts: after the one of the bases comes one of each localiser, within milliseconds.
        while self._received.bundles:
            arrival = self._received.bundles.popleft()
            if (bundle := arrival.read(TFMessage)) is None:
                continue
            stamp = bases_stamp(bundle)
            if stamp and stamp < self.stamp:
                # What was known of the other time does not count.
                self.buffer.clear()
                self._begin_era(stamp)
            self._taken[names.TF] = arrival.number
            self.number, self.time, self.stamp = arrival.number, arrival.time, stamp or self.stamp
            self.buffer.set_transforms(bundle.transforms, names.TF, self.stamp)
        found = {}
        for robot_id in robots:
            if names.TF not in self._taken:
                self._take_truth(robot_id)
            base, odom = (names.robot_frame(robot_id, frame) for frame in (names.BASE_FOOTPRINT, names.ODOM))
            if pose := self.pose_of(base) or (self.pose_of(odom) if stands else None):
                found[robot_id] = pose
        self.from_truth = names.TF not in self._taken and bool(found)
        return found

    def _take_truth(self, robot_id: int) -> None:
        arrival, truth = self._take(names.robot_key(robot_id, names.GROUND_TRUTH), Odometry)
        if arrival is None or truth is None:
            return
        odom, base = (names.robot_frame(robot_id, each) for each in (names.ODOM, names.BASE_FOOTPRINT))
        header, pose = Header(truth.header.stamp, names.MAP_FRAME), truth.pose.pose
        stamp = ns_from_time(header.stamp)
        if stamp <= (self._truths.latest_common_time(names.MAP_FRAME, base) or -1):
            # Time was set back, or the robot was moved while it stood.
            self._truths.forget(odom)
            self._truths.forget(base)
        place = Transform(Vector3(pose.position.x, pose.position.y), pose.orientation)
        self._truths.set_transform(TransformStamped(header, odom, place), odom)
        self._truths.set_transform(TransformStamped(Header(header.stamp, odom), base), odom)
        if arrival.number > self.number:
            if stamp < self.stamp:
                self._begin_era(stamp)
            self.number, self.time, self.stamp = arrival.number, arrival.time, stamp

    def _begin_era(self, stamp: int) -> None:
        """Time was set back to `stamp` (ns)."""
        self.eras += 1
        self._received.forget_after(stamp)

    def _find(self, parent: str, frame: str, stamp: int) -> Pose2 | None:
        with suppress(TransformException):
            buffer = self.buffer if names.TF in self._taken else self._truths
            return shown(buffer.lookup_pose2(parent, frame, stamp)[0])
        return None

    def pose_of(self, frame: str, stamp: int = 0) -> Pose2 | None:
        """The pose of a frame in `map` at `stamp` (ns), or its newest where it is not known for then."""
        name = names.strip_slash(frame)
        if name == names.MAP_FRAME:
            return Pose2(0.0, 0.0, 0.0)
        return self._find(names.MAP_FRAME, name, stamp) or (self._find(names.MAP_FRAME, name, 0) if stamp else None)

    def base_at(self, robot_id: int, stamp: int) -> Pose2 | None:
        """The pose in `map` of a robot's base at `stamp` (ns); None as long as its motion is not known until then.

        Where odometry begins in `map` may be older: a localiser says it seldom.
        """
        odom, base = (names.robot_frame(robot_id, each) for each in (names.ODOM, names.BASE_FOOTPRINT))
        origin, moved = self.pose_of(odom, stamp), self._find(odom, base, stamp)
        return None if origin is None or moved is None else shown(origin.compose(moved))

    def level(self, robot_id: int, scan: LaserScan) -> LevelScan:
        """A robot's scan as its base sees it."""
        if robot_id not in self._lasers:
            self._lasers[robot_id] = LaserMounts(robot_id, self.buffer)
        return self._lasers[robot_id].level(scan)

    def truth_of(self, robot_id: int) -> tuple[Pose2, Pose2] | None:
        """Where a robot is in `map`, and where it took itself to be then; None where one of them is not known."""
        if robot_id not in self.compared:
            self._compared.pop(robot_id, None)
            return None
        found = self._received.read(names.robot_key(robot_id, names.GROUND_TRUTH), Odometry)
        # What came before the robot was moved tells nothing of where it is now.
        if found is not None and found[0].number > self._taken.get(names.TF_STATIC, 0):
            truth, stamp = shown(pose2_of(found[1].pose.pose)), ns_from_time(found[1].header.stamp)
            # The transforms of its tick come after it: until then the one before counts.
            believed = self._find(names.MAP_FRAME, names.robot_frame(robot_id, names.BASE_FOOTPRINT), stamp)
            if truth is not None and believed is not None:
                self._compared[robot_id] = truth, believed
        return self._compared.get(robot_id)


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
        self.drawables = Drawables((), self.received)
        self.places = Places(self.received)
        self.queries = TeamQueries(node, self.received, lambda: self.on_news())
        self.diagnosis = Diagnosis(node.bus.options, lambda: self.on_news())
        self.viewers: dict[int, Viewer] = {}
        self.lease_of: Callable[[int], int | None] = lambda robot_id: None
        """The viewer that drives a robot."""
        self.poses: dict[int, Pose2] = {}
        """The robots' newest poses in `map`. Replaced as a whole."""
        self._subscriptions = Subscriptions(node.bus, self.received)
        self._looks = 0
        self._asks = 0

    @property
    def namespace(self) -> str:
        """Of the team on its router; empty for none."""
        options = self.node.bus.options
        return (options.namespace if options else None) or ""

    @property
    def period(self) -> float:
        """Host seconds between two frames of one page."""
        sim = self.queries.sim
        is_fast = sim is not None and sim.real_time_factor > FAST and not (sim.paused or sim.finished)
        return FAST_PERIOD if is_fast else PERIOD

    def robots(self, *, with_bodies: bool = False) -> set[int]:
        """The robots of the world, and those that have a process; `with_bodies` only those of the world and
        real bases. Without a simulator all that were heard."""
        if (sim := self.queries.sim) is not None:
            # What was heard of one that was removed from the world stays with this process.
            held = self.queries.processes().items()
            return {i for i, own in held if not with_bodies or names.base_name(i) in own} | set(sim.robots)
        return {robot_id for robot_id, _, _ in self.received.of_robots()} | self.queries.robots()

    def _localised(self) -> set[int]:
        """The robots whose place a localisation estimates, and those that a page shows in detail."""
        selected = {i for viewer in self.viewers.values() for i in viewer.look.selected}
        return selected | {i for i, topic, _ in self.received.of_robots() if topic == names.AMCL_POSE}

    def add(self, viewer: Viewer) -> None:
        with self.node.changed:
            self.viewers = {**self.viewers, viewer.number: viewer}
            self.changed()
            self.ask_soon()

    def remove(self, viewer: Viewer) -> None:
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
        self.drawables = Drawables((each.key for each in self.queries.declarations if each.publishes), self.received)
        sim, aggregator = self.queries.sim, self.queries.speaks(names.AGGREGATOR)
        self.places.compared = self._localised() if sim is not None else ()
        wanted = topics_of(
            viewers.values(), self.poses, self.drawables, aggregator=aggregator, truth_of=self.places.compared
        )
        if sim is not None:
            self.received.keep_robots(self.robots())
        self._subscriptions.match(wanted)
        if not viewers:
            self.received.clear()
            self.places, self.poses = Places(self.received), {}
        self.node.wait(lambda: self._looks != looks, LOOK if viewers else REST)

    def _ask(self) -> None:
        try:
            while not self.node.stopping:
                self._ask_once()
        except BaseException as error:
            self.node.fail(error)

    def _ask_once(self) -> None:
        viewers, asks = self.viewers, self._asks
        docs = {name for viewer in viewers.values() for name in viewer.look.docs}
        self.diagnosis.want("doctor" in docs)
        if viewers:
            layers = {layer for viewer in viewers.values() for layer in viewer.look.layers}
            inspected = {i for viewer in viewers.values() if (i := viewer.inspected) is not None}
            self.queries.ask(layers, docs, inspected, self._subscriptions.opened)
        self.node.wait(lambda: self._asks != asks, self.queries.period if viewers else REST)

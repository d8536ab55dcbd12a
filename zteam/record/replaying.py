"""The process of a replay: it publishes a recording on its keys and holds the names of its processes.

It stands for the team that was recorded, so it answers what tools ask of a simulator and of an aggregator, and refuses
what would change the team.
"""

import threading
from collections.abc import Callable, Iterable
from typing import Any

from zteam import names
from zteam.bus import Bus, Change, Deferred, NoRequest, Publisher
from zteam.bus.presence import Claim, find_processes
from zteam.bus.transport import Handle
from zteam.clock import Every, monotonic, to_ns, to_seconds
from zteam.config.robot_ids import format_robot_ids
from zteam.errors import BusError, DuplicateNameError, UsageError, log
from zteam.messages import Message, TFMessage, encode
from zteam.messages.topics import is_latched, is_measured
from zteam.node.process_node import ProcessNode
from zteam.node.process_options import ReplayOptions
from zteam.record.client import ReplayStatus, SeekRequest, SpeedRequest, StepRequest
from zteam.record.comparing import publisher_of
from zteam.record.timeline import RECENT, Timeline, transforms_in
from zteam.record.writing import Entry
from zteam.simulator.client import SimStatus
from zteam.transforms import Buffer
from zteam.transforms.answers import answer_history, answer_lookups
from zteam.transforms.client import BundleReply, HistoryRequest, LookupRequest

_PERIOD = 0.01
"""Host seconds between two looks at what is due."""
_REST = 1.0
"""Host seconds between two looks while it stands, and between two statuses of a robot, which seems to hang without."""
_MOST = to_ns(0.2)
"""Nanoseconds of the recording that are published at once, so that queries do not wait long."""
_OTHERS = frozenset({names.RECORDER, names.REPLAY, names.LAUNCHER, names.ROUTER, names.GOALS})
"""Processes that write logs and are no part of a team."""
_REFUSED_BY_SIMULATOR = (
    "pause", "resume", "speed", "step", "stand", "finish", "reset", "spawn", "remove", "move", "fault", "report",
)  # fmt: skip
_REFUSED_BY_ROBOTS = names.ENGAGE, names.RELEASE, "set_parameters", f"{names.NAVIGATION}/cancel"


def recorded_names(keys: Iterable[str], *, is_simulated: bool) -> set[str]:
    """The names of the processes that have published on these keys."""
    found = set()
    for key in keys:
        target = names.split_robot_key(key)
        if key.startswith(f"{names.SIMULATOR}/"):
            found.add(names.SIMULATOR)
        elif (name := names.process_of(key, names.LOG)) is not None and not names.is_view(name):
            found.add(name)
        elif target is not None and target[1] == names.STATUS:
            found.add(names.robot_name(target[0]))
        elif target is not None and is_measured(key) and not is_simulated and target[1] != names.CMD_VEL:
            found.add(names.base_name(target[0]))
        elif key in (names.TEAM_STATUS, names.MAP):
            found.add(
                names.MONITOR if key == names.TEAM_STATUS else names.SIMULATOR if is_simulated else names.MAP_SERVER
            )
        else:
            found.add(publisher_of(key))
    return found - _OTHERS - {""}


class Replay:
    """Where a replay is. Any thread may make calls."""

    def __init__(self, bus: Bus, timeline: Timeline, options: ReplayOptions) -> None:
        self._bus, self.timeline, self._options = bus, timeline, options
        self.lock = threading.RLock()
        self.now = timeline.start
        self.speed, self.is_paused = options.speed, options.pause
        self.buffer = Buffer()
        """The tree of now, as an aggregator has it."""
        self._looked = 0.0
        """Host time of the last look at what is due."""
        self._statuses: dict[str, Entry] = {}
        """The newest status of each robot."""
        self._publishers: dict[tuple[str, str], Publisher[Any]] = {}
        for topic in sorted(timeline.topics):
            try:
                self._publishers[topic] = self._open(topic)
            except UsageError as error:
                log.warning("%s is left out: %s", topic[0], error)

    def _open(self, topic: tuple[str, str]) -> Publisher[Message]:
        key, kind = topic
        return self._bus.publisher(key, self.timeline.recording.type_of(kind), latched=is_latched(key))

    def _put(self, entries: Iterable[Entry]) -> None:
        for entry in entries:
            if (publisher := self._publishers.get((entry.key, entry.type))) is not None:
                publisher.put_owned(entry.data)
            if entry.key == names.TF_STATIC:
                self.buffer.set_all_static(transforms_in(entry), names.TF)
            elif entry.key == names.TF:
                self.buffer.set_transforms(transforms_in(entry), names.TF)
            elif entry.key.endswith(f"/{names.STATUS}"):
                self._statuses[entry.key] = entry

    def go_to(self, time: int) -> None:
        """Publish the state of a time (ns), and go on from there."""
        with self.lock:
            self.now, self._looked = min(max(time, self.timeline.start), self.timeline.end), monotonic()
            self.buffer.clear()
            self.publish_state()

    def publish_state(self) -> None:
        """Publish the state of now: the time, what is latched, and the rest."""
        timeline = self.timeline
        with self.lock:
            # At the start no message is older than another one.
            is_first = self.now == timeline.start
            state = timeline.between(self.now - 1, self.now) if is_first else timeline.state_at(self.now)
            known = {(entry.key, entry.type) for entry in state}
            for topic, publisher in [*self._publishers.items()]:
                if is_latched(topic[0]) and topic not in known:
                    # A late subscriber must not get what comes later in the recording.
                    publisher.close()
                    self._publishers[topic] = self._open(topic)
            self._put(sorted(state, key=lambda entry: (entry.key != names.CLOCK, not is_latched(entry.key))))

    def advance(self) -> bool:
        """Publish what has become due since the last look; whether more is due already."""
        timeline = self.timeline
        with self.lock:
            host = monotonic()
            passed, self._looked = to_ns((host - self._looked) * self.speed), host
            if self.is_paused:
                return False
            until = min(self.now + min(passed, _MOST), timeline.end)
            self._put(timeline.between(self.now, until))
            self.now = until
            if until == timeline.end and self._options.loop:
                self.go_to(timeline.start)
            elif until == timeline.end:
                self.is_paused = True
                log.info("the recording is over: the replay stands at its end")
            return passed > _MOST

    def repeat_statuses(self) -> None:
        """Publish the robots' newest statuses again: they are there, though the recording has none for now."""
        with self.lock:
            self._put([*self._statuses.values()])

    # Changes

    def pause(self) -> None:
        self.is_paused = True

    def resume(self) -> None:
        """Go on; at the end, from the start."""
        with self.lock:
            self.is_paused, self._looked = False, monotonic()
            if self.now == self.timeline.end:
                self.go_to(self.timeline.start)

    def step(self, ticks: int) -> None:
        """Go so many ticks on or back, and stand there."""
        timeline = self.timeline
        with self.lock:
            self.is_paused = True
            number = min(max(timeline.tick_at(self.now) + ticks, 1), len(timeline.ticks))
            before, due = self.now, timeline.ticks[number - 1]
            if 0 <= due - before <= RECENT:
                self._put(timeline.between(before, due))
                self.now = due
            else:
                self.go_to(due)

    def set_speed(self, speed: float) -> None:
        with self.lock:
            self.speed = speed

    # Answers

    def status(self) -> ReplayStatus:
        timeline, now = self.timeline, self.now
        return ReplayStatus(
            str(self._options.file), timeline.start, timeline.end, now, timeline.tick_at(now), len(timeline.ticks),
            self.speed, self.is_paused, self._options.loop, timeline.is_lockstep,
        )  # fmt: skip

    def simulator_status(self, world: str, robots: list[int]) -> SimStatus:
        """As the simulator that was recorded would answer. Lock-step is over: nothing waits for anything."""
        timeline, now = self.timeline, self.now
        seed = int(timeline.recording.facts.get("seed", "0"))
        return SimStatus(
            world, robots, timeline.period, seed, timeline.clock_at(now), timeline.tick_at(now), self.speed, self.speed,
            paused=self.is_paused, instance=self._bus.instance,
        )  # fmt: skip

    def bundle(self) -> BundleReply:
        """The transforms of now."""
        with self.lock:
            state = self.timeline.state_at(self.now)
        found = [each for entry in state if entry.key == names.TF for each in transforms_in(entry)]
        return BundleReply(encode(TFMessage(found)))


def run_replay(node: ProcessNode, timeline: Timeline, options: ReplayOptions, world: str = "") -> None:
    """Replay until the process is asked to stop; `world` is the name of the world that was recorded.

    Raises DuplicateNameError where a process of one of its names is alive.
    """
    bus = node.bus
    held = recorded_names(timeline.keys, is_simulated=timeline.is_simulated)
    claims = [Claim(bus, name) for name in sorted(held)]
    robots = sorted({target[0] for key in timeline.keys if (target := names.split_robot_key(key)) is not None})
    replay = Replay(bus, timeline, options)
    _serve(node, replay)
    if names.SIMULATOR in held:
        _answer_for_simulator(bus, replay, lambda: replay.simulator_status(world, robots))
    if names.AGGREGATOR in held:
        _answer_for_aggregator(bus, replay)
    for robot_id in robots:
        for service in _REFUSED_BY_ROBOTS:
            bus.serve(names.robot_key(robot_id, service), NoRequest, _refuse)
    _check_bases(bus, robots)
    for claim in claims:
        claim.win(node.stop.request)
        node.claim.under_name.append(Handle(claim.release))
    # What is asked for meanwhile comes after the begin.
    with replay.lock:
        node.become_present()
        replay.go_to(timeline.start + to_ns(options.begin))
    size = to_seconds(timeline.end - timeline.start)
    log.info("replaying %s: %.1f s of robots %s", options.file, size, format_robot_ids(robots) or "none")
    beat = Every(_REST, after=_REST)
    while not node.stopping:
        if not replay.advance():
            if replay.is_paused:
                node.wait(lambda: not replay.is_paused, beat.left(), by_inputs=False)
            else:
                node.wait(lambda: False, _PERIOD, by_inputs=False)
        if beat.due() and (replay.is_paused or replay.speed < 1.0):
            replay.repeat_statuses()


def _check_bases(bus: Bus, robots: list[int]) -> None:
    """Raise DuplicateNameError where the base of a recorded robot is alive: recorded commands would drive it."""
    for info in find_processes(bus, timeout=1.0):
        if names.base_robot_of(info.name) in robots and info.instance != bus.instance:
            raise DuplicateNameError(f"{info.name} is alive: a replay of its commands would drive it; use --namespace")


def _refuse(_request: object) -> None:
    raise BusError("this is a recording (zteam replay): it cannot be changed")


def _serve(node: ProcessNode, replay: Replay) -> None:
    """Serve `replay/…`."""

    def serve(service: str, request_type: Any, change: Callable[[Any], None]) -> None:
        def answer(request: Any) -> Deferred:
            def finish() -> ReplayStatus:
                change(request)
                node.wake()
                return replay.status()

            return Deferred(finish)

        node.bus.serve(names.service_key(names.REPLAY, service), request_type, answer)

    serve("status", NoRequest, lambda _: None)
    serve("pause", Change, lambda _: replay.pause())
    serve("resume", Change, lambda _: replay.resume())
    serve("seek", SeekRequest, lambda request: replay.go_to(to_ns(request.time)))
    serve("step", StepRequest, lambda request: replay.step(request.ticks))
    serve("speed", SpeedRequest, lambda request: replay.set_speed(request.speed))


def _answer_for_simulator(bus: Bus, replay: Replay, status: Callable[[], SimStatus]) -> None:
    def repeat(_request: Change) -> Deferred:
        def finish() -> SimStatus:
            replay.publish_state()
            return status()

        return Deferred(finish)

    bus.serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: status())
    # It changes nothing: new subscribers get what is there.
    bus.serve(names.service_key(names.SIMULATOR, "repeat"), Change, repeat)
    for service in _REFUSED_BY_SIMULATOR:
        bus.serve(names.service_key(names.SIMULATOR, service), NoRequest, _refuse)


def _answer_for_aggregator(bus: Bus, replay: Replay) -> None:
    serve, service, buffer = bus.serve, names.service_key, replay.buffer
    serve(service(names.AGGREGATOR, "lookup"), LookupRequest, lambda request: answer_lookups(buffer, request))
    serve(service(names.AGGREGATOR, "history"), HistoryRequest, lambda request: answer_history(buffer, request))
    serve(service(names.AGGREGATOR, "frames"), NoRequest, lambda _: buffer.frames())
    serve(service(names.AGGREGATOR, "conflicts"), NoRequest, lambda _: list[str]())
    serve(service(names.AGGREGATOR, "newest"), NoRequest, lambda _: Deferred(replay.bundle))
    serve(service(names.AGGREGATOR, "static"), NoRequest, _refuse)

"""Replays: what is published, when, and what a jump shows."""

import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from support.limits import LIMIT
from support.recorded import FACTS, STEP, drive, entry, write
from support.transforms import stamped
from zteam import names
from zteam.bus import Bus, Change, MemoryHub
from zteam.bus.graph import find_nodes
from zteam.bus.presence import Claim
from zteam.bus.transport import RawSample
from zteam.errors import BusError, DuplicateNameError, UsageError, ZteamError
from zteam.messages import BaseInfo, Clock, Log, Odometry, RobotStatus, String, TFMessage, time_from_ns
from zteam.node.process_node import ProcessNode
from zteam.node.process_options import ReplayOptions
from zteam.node.shutdown import Stop
from zteam.node.stopping import StopReply
from zteam.record import replaying
from zteam.record.client import ReplayClient
from zteam.record.recording import Recording
from zteam.record.replaying import Replay, recorded_names, run_replay
from zteam.record.timeline import Timeline
from zteam.record.writing import Entry, RecordingWriter
from zteam.simulator.client import SimulatorClient, read_status
from zteam.transforms.client import TransformClient, find_frames

TICKS = 30


def clock(tick: int, time: int = -1) -> Entry:
    return entry("clock", Clock(time_from_ns(tick * STEP)), tick, time)


def frames(key: str, tick: int, *pairs: tuple[str, str]) -> Entry:
    """Transforms of a tick: each frame is as many metres ahead of its parent."""
    return entry(key, TFMessage([stamped(parent, child, tick * STEP, x=float(tick)) for parent, child in pairs]), tick)


def run_of(ticks: int) -> list[Entry]:
    """A run whose robot 0 is localised in tick 2 alone, and whose map of robot 1 comes in tick 20."""
    found = [
        entry("tf_static", TFMessage([stamped("robot_0/base_footprint", "robot_0/base_link", 0)]), 0, 0),
        entry("recorder/ground_truth_sha256", String("x"), 1),
    ]
    of_ticks = drive(ticks)
    for tick in range(1, ticks + 1):
        found += [each for each in of_ticks if each.time == tick * STEP or (tick == 1 and not each.time)]
        found.append(frames("tf", tick, ("robot_0/odom", "robot_0/base_footprint")))
        found.append(clock(tick))
        if tick == 2:
            found.append(frames("tf", tick, ("map", "robot_0/odom")))
            found.append(entry("chat", String("early"), 0, tick * STEP))
        if tick == 20:
            found.append(entry("robot_1/base_info", BaseInfo(), tick))
    return found


class Heard:
    """What comes over the bus, and the host's clock."""

    def __init__(self, hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
        self.samples: list[RawSample] = []
        self.time = 100.0
        hub.bus().subscribe_raw("**", self.samples.append)
        monkeypatch.setattr(replaying, "monotonic", lambda: self.time)

    def take(self) -> list[str]:
        """The keys since the last call, in order."""
        keys = [sample.key for sample in self.samples]
        self.samples.clear()
        return keys


@pytest.fixture
def heard(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> Heard:
    return Heard(hub, monkeypatch)


def open_replay(hub: MemoryHub, file: Path, **options: Any) -> Replay:
    return Replay(hub.bus(), Timeline(Recording(file)), ReplayOptions(file, **options))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return write(tmp_path / "run.mcap", run_of(TICKS))


def play(replay: Replay, heard: Heard, seconds: float) -> None:
    """Let host time pass in steps that no look can miss."""
    for _ in range(round(seconds / 0.05)):
        heard.time += 0.05
        replay.advance()


def test_messages_come_as_they_were_recorded(hub: MemoryHub, file: Path, heard: Heard) -> None:
    """Each once, in the order of their times, with their bytes and types; none that would draw a participant in."""
    replay = open_replay(hub, file)
    replay.go_to(0)
    first = heard.take()
    assert first == ["clock", "tf_static", "sim/log", *(f"robot_{i}/base_pose_ground_truth" for i in (0, 1)), "tf"]
    for _ in range(TICKS):
        play(replay, heard, 0.1)
    sent = [sample for sample in heard.samples if sample.key == "robot_0/base_pose_ground_truth"]
    due = [each for each in drive(TICKS) if each.key == "robot_0/base_pose_ground_truth"][1:]
    assert [sample.payload for sample in sent] == [each.data for each in due]
    assert {sample.encoding for sample in sent} == {"application/cdr;nav_msgs/msg/Odometry"}
    keys = heard.take()
    assert not [key for key in keys if key.endswith("/done") or key == "sim/tick" or key.startswith("recorder/")]
    assert keys.count("clock") == TICKS - 1
    assert replay.status().is_paused and replay.now == TICKS * STEP


@pytest.mark.parametrize("speed", [0.5, 1.0, 4.0])
def test_the_pace(hub: MemoryHub, file: Path, heard: Heard, speed: float) -> None:
    """Recorded time passes so many times as fast as the host's, and not at all in a pause."""
    replay = open_replay(hub, file, speed=speed)
    replay.go_to(0)
    play(replay, heard, 0.5)
    assert replay.now == pytest.approx(STEP + 0.5e9 * speed, abs=10)
    replay.pause()
    heard.take()
    play(replay, heard, 5.0)
    assert heard.take() == []
    replay.resume()
    replay.set_speed(1.0)
    before = replay.now
    play(replay, heard, 0.2)
    assert replay.now - before == pytest.approx(0.2e9, abs=10)


def test_a_jump_shows_the_whole_state(hub: MemoryHub, file: Path, heard: Heard) -> None:
    """First the time, then what is latched, then the newest message of each key and the newest place of each frame."""
    replay = open_replay(hub, file)
    replay.go_to(0)
    heard.take()
    replay.go_to(25 * STEP + 1)
    keys = [sample.key for sample in heard.samples]
    assert keys[:3] == ["clock", "tf_static", "robot_1/base_info"]
    # The older one first; words of 2.3 s ago are over.
    assert keys.count("tf") == 2 and "chat" not in keys
    stamps = {sample.key: sample.payload for sample in heard.samples}
    assert stamps["clock"] == clock(25).data
    assert stamps["robot_0/base_pose_ground_truth"] == drive(25)[-4].data
    assert len(keys) == len({(sample.key, sample.payload) for sample in heard.samples})
    heard.take()
    replay.go_to(2 * STEP)
    keys = heard.take()
    assert "chat" in keys and "robot_1/base_info" not in keys
    late = list[str]()
    hub.bus().subscribe_raw("**", lambda sample: late.append(sample.key), latched=True)
    assert late == ["tf_static"]


def test_steps(hub: MemoryHub, file: Path, heard: Heard) -> None:
    """On, back, and far away; the replay stands afterwards, within the recording."""
    replay = open_replay(hub, file)
    replay.go_to(5 * STEP)
    heard.take()
    replay.step(1)
    assert (replay.now, replay.status().tick, replay.is_paused) == (6 * STEP, 6, True)
    assert heard.take().count("clock") == 1
    replay.step(-2)
    assert replay.now == 4 * STEP
    assert heard.take()[0] == "clock"
    replay.step(3)
    assert heard.take().count("clock") == 3
    for ticks, now in ((1000, TICKS), (-1000, 1)):
        replay.step(ticks)
        assert replay.now == now * STEP


def test_the_end(hub: MemoryHub, file: Path, heard: Heard) -> None:
    """It stands there until it is resumed, which begins anew; a loop goes on by itself."""
    replay = open_replay(hub, file)
    replay.go_to((TICKS - 1) * STEP)
    play(replay, heard, 1.0)
    assert (replay.now, replay.is_paused) == (TICKS * STEP, True)
    replay.resume()
    assert (replay.now, replay.is_paused) == (STEP, False)
    replay = open_replay(hub, file, loop=True)
    replay.go_to((TICKS - 1) * STEP)
    play(replay, heard, 0.3)
    assert (replay.now, replay.is_paused) == (pytest.approx(3 * STEP, abs=10), False)


def test_a_world_that_was_put_back(hub: MemoryHub, tmp_path: Path, heard: Heard) -> None:
    """The time of the recording goes on, and the clock goes back."""
    both = [clock(tick) for tick in range(1, 11)] + [clock(tick) for tick in range(1, 6)]
    replay = open_replay(hub, write(tmp_path / "run.mcap", both))
    timeline = replay.timeline
    assert (timeline.start, timeline.end, len(timeline.ticks)) == (STEP, 15 * STEP, 15)
    assert [timeline.clock_at(tick * STEP) for tick in (1, 10, 11, 15)] == [STEP, 10 * STEP, STEP, 5 * STEP]
    replay.go_to(0)
    play(replay, heard, 1.5)
    assert [sample.payload for sample in heard.samples] == [each.data for each in both]


def test_real_robots(hub: MemoryHub, tmp_path: Path, heard: Heard) -> None:
    """Without a clock none is published; a tenth of a second is a tick."""
    begin = 1_700_000_000 * 10**9
    said = [entry("robot_0/odom", Odometry(), 0, begin + n * STEP // 2) for n in range(5)]
    replay = open_replay(hub, write(tmp_path / "run.mcap", said))
    assert (replay.status().ticks, replay.timeline.is_simulated) == (3, False)
    replay.go_to(0)
    play(replay, heard, 0.5)
    assert heard.take() == ["robot_0/odom"] * 5
    keys = ["robot_0/odom", "robot_0/status", "map", "planner/log", "recorder/log", "view_1/log", "up/log"]
    assert recorded_names(keys, is_simulated=False) == {"base_0", "robot_0", "map", "planner"}
    assert recorded_names(["clock", *keys], is_simulated=True) == {"sim", "robot_0", "planner"}


@pytest.mark.parametrize("key", ["tf", "tf_static"])
def test_transforms_that_cannot_be_read_end_no_replay(hub: MemoryHub, tmp_path: Path, heard: Heard, key: str) -> None:
    """A recorder keeps what any program publishes: they are published as they are, and tell the tree nothing."""
    broken = Entry(key, TFMessage.ros_type, 3 * STEP, b"short", 0)
    replay = open_replay(hub, write(tmp_path / "run.mcap", [*run_of(TICKS), broken]))
    replay.go_to(0)
    play(replay, heard, 1.0)
    assert b"short" in [sample.payload for sample in heard.samples if sample.key == key]
    replay.go_to(3 * STEP)
    assert replay.buffer.frames() and replay.bundle()


def test_a_recording_that_was_cut_off(hub: MemoryHub, tmp_path: Path, heard: Heard) -> None:
    """It is replayed up to there; what has nothing is refused."""
    replay = open_replay(hub, write(tmp_path / "cut.mcap", run_of(5), finished=False))
    replay.go_to(5 * STEP)
    assert "robot_0/base_pose_ground_truth" in heard.take()
    with pytest.raises(UsageError, match="nothing to replay"):
        Timeline(Recording(write(tmp_path / "none.mcap", [entry("recorder/log", Log(), 0, 0)])))


def test_types_that_are_not_installed(hub: MemoryHub, tmp_path: Path, heard: Heard) -> None:
    """Their bytes go out under their names; what zteam cannot name is left out."""
    file = tmp_path / "run.mcap"
    writer = RecordingWriter(file, FACTS, {}, force=True)
    for kind, text in (("a_msgs/msg/Gone", "string what\n"), ("a_msgs/msg/Odd", "wstring what\n")):
        writer.define(kind, text)
        writer.put(Entry(f"camera/{kind[11:].lower()}", kind, STEP, b"\0\1\0\0", 0))
    writer.finish({})
    open_replay(hub, file).go_to(0)
    assert [(sample.key, sample.encoding, sample.payload) for sample in heard.samples] == [
        ("camera/gone", "application/cdr;a_msgs/msg/Gone", b"\0\1\0\0")
    ]


@pytest.fixture
def begin(hub: MemoryHub) -> Iterator[Callable[..., Callable[[], None]]]:
    """Begins the process of a replay; the call that it returns ends it and raises its error."""
    ends: list[Callable[[], None]] = []

    def begin(file: Path, **options: Any) -> Callable[[], None]:
        stop, errors, begun = Stop(), list[BaseException](), threading.Event()
        bus = hub.bus()
        bus.hold()
        node = ProcessNode(names.REPLAY, bus, stop)
        node.on_present(begun.set)

        def work() -> None:
            try:
                run_replay(node, Timeline(Recording(file)), ReplayOptions(file, **options), "arena")
            except ZteamError as error:
                errors.append(error)
                begun.set()
            finally:
                node.close()

        thread = threading.Thread(target=work)
        thread.start()
        assert begun.wait(LIMIT)

        def end() -> None:
            stop.request("enough")
            thread.join()
            for error in errors:
                raise error

        ends.append(lambda: (stop.request("the test is over"), thread.join())[1])
        return end

    yield begin
    for end in ends:
        end()


def test_tools_find_a_team(hub: MemoryHub, file: Path, begin: Callable[..., Callable[[], None]]) -> None:
    """Its names, the state of its world, its transforms; and the replay answers its client."""
    end = begin(file, pause=True)
    bus, client = hub.bus(), ReplayClient(hub.bus())
    assert client.seek(2.05).now == 2_050_000_000
    assert [info.name for info in find_nodes(bus)] == ["replay", "robot_0", "robot_1", "sim", "tf"]
    status = client.status()
    assert (status.file, status.start, status.end, status.tick, status.ticks) == (str(file), STEP, TICKS * STEP, 20, 30)
    assert (status.is_paused, status.is_loop, status.is_lockstep, status.speed) == (True, False, True, 1.0)
    world = read_status(bus)
    assert world is not None
    assert (world.world, world.robots, world.interval, world.seed) == ("arena", [0, 1], STEP, 3)
    assert (world.now, world.tick, world.paused, world.lockstep) == (2_050_000_000, 20, True, False)
    found = TransformClient(bus).lookup_transform("robot_0/odom", "robot_0/base_link")
    assert found.transform.translation.x == 20.0
    assert "robot_0/base_footprint" in (find_frames(bus) or {})
    assert client.step(-1).tick == 19
    assert client.set_speed(3.0).speed == 3.0
    assert not client.resume().is_paused
    assert client.pause().is_paused
    assert client.seek(1e9).now == TICKS * STEP
    end()
    assert find_nodes(bus) == []
    with pytest.raises(BusError, match="zteam replay FILE"):
        client.status()


def test_nothing_commands_a_recording(hub: MemoryHub, file: Path, begin: Callable[..., Callable[[], None]]) -> None:
    """Changes are refused with the reason; what only asks for the state again is not."""
    begin(file, pause=True)
    bus = hub.bus()
    simulator = SimulatorClient(bus)
    for change in (simulator.pause, simulator.reset, simulator.step, lambda: simulator.spawn(0.0, 0.0)):
        with pytest.raises(BusError, match="this is a recording"):
            change()
    with pytest.raises(BusError, match="this is a recording"):
        bus.ask("robot_0/stop/engage", StopReply, Change())
    for refused in ("replay/seek", "replay/speed"):
        with pytest.raises(BusError, match="bad request"):
            bus.ask(refused, StopReply, Change())
    heard = list[str]()
    bus.subscribe_raw("**", lambda sample: heard.append(sample.key))
    assert simulator.repeat().tick == 1
    assert {"clock", "tf", "robot_1/base_pose_ground_truth"} <= set(heard)


@pytest.mark.parametrize("name", ["robot_1", "sim", "base_0", "replay"])
def test_beside_a_living_team_it_is_refused(
    hub: MemoryHub, file: Path, begin: Callable[..., Callable[[], None]], name: str
) -> None:
    """With a line that names the process; nothing was published."""
    heard = list[str]()
    bus: Bus = hub.bus()
    bus.subscribe_raw("**", lambda sample: heard.append(sample.key))
    Claim(bus, name).win(lambda _: None)
    end = begin(file)
    with pytest.raises(DuplicateNameError, match=name):
        end()
    assert heard == []


def test_robots_of_a_replay_that_stands_do_not_seem_to_hang(
    hub: MemoryHub, tmp_path: Path, begin: Callable[..., Callable[[], None]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their newest status comes again and again."""
    monkeypatch.setattr(replaying, "_REST", 0.02)
    file = write(tmp_path / "run.mcap", [clock(1), entry("robot_0/status", RobotStatus(), 0, STEP), clock(2)])
    enough, came = threading.Event(), list[str]()

    def on_status(key: str, _: RobotStatus) -> None:
        came.append(key)
        if len(came) > 3:
            enough.set()

    hub.bus().subscribe("robot_0/status", RobotStatus, on_status)
    begin(file, pause=True)
    assert enough.wait(LIMIT)

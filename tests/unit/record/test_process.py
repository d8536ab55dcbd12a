"""The recorder's process: what comes goes into the file, until it is stopped or the disk is full."""

import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import pytest
from mcap.reader import make_reader

from support.limits import LIMIT
from zteam import names
from zteam.bus import MemoryHub
from zteam.errors import UsageError, ZteamError
from zteam.messages import Clock, Message, OccupancyGrid, String, TFMessage, Time, time_from_ns
from zteam.node.node import Node
from zteam.node.process_node import ClockMode
from zteam.node.process_options import RecorderOptions
from zteam.node.shutdown import Stop
from zteam.record import writing
from zteam.record.process import run_recorder


class Seen(Message):
    """A type of a user's own."""

    ros_type = "my_msgs/msg/Seen"
    what: str = ""


@pytest.fixture
def record(hub: MemoryHub, tmp_path: Path) -> Iterator[Callable[..., Callable[[], Path]]]:
    """Begins a recording; the call that it returns ends it, raises its error, and returns the file."""
    stops: list[Stop] = []

    def begin(clock: ClockMode = "wall", code: int = 0, **options: object) -> Callable[[], Path]:
        stop, file, errors, begun = Stop(), tmp_path / "run.mcap", list[ZteamError](), threading.Event()
        stops.append(stop)
        node = Node("recorder", hub.bus(), stop, clock)
        node.on_present(begun.set)

        def work() -> None:
            try:
                run_recorder(node, msgspec.convert({"file": file, **options}, RecorderOptions), {"note": b"text"})
            except ZteamError as error:
                errors.append(error)
                begun.set()
            finally:
                node.close()

        thread = threading.Thread(target=work)
        thread.start()
        assert begun.wait(LIMIT)

        def end() -> Path:
            stop.request("enough")
            thread.join()
            for error in errors:
                raise error
            assert node.exit_code == code
            return file

        return end

    yield begin
    for stop in stops:
        stop.request("the test is over")


def topics(file: Path) -> dict[str, int]:
    """The number of messages of each topic in a file."""
    with file.open("rb") as data:
        summary = make_reader(data).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    counts = summary.statistics.channel_message_counts
    return {channel.topic: counts[number] for number, channel in summary.channels.items()}


def test_it_records_what_comes_and_what_was_latched(hub: MemoryHub, record: Callable[..., Callable[[], Path]]) -> None:
    """Each message once; of a type of the user's own with the definition that its node serves. What names no type is
    left out."""
    hub.bus().publisher("map", OccupancyGrid, latched=True).put(OccupancyGrid())
    end = record()
    for text in ("one", "two"):
        hub.bus().publisher("chat", String).put(String(text))
    hub.bus().publisher("camera/seen", Seen).put(Seen("a cat"))
    hub.bus().transport.declare_publisher("odd", "text/plain", False).put(b"{}")
    file = end()
    found = topics(file)
    assert {topic: found[topic] for topic in ("/map", "/chat", "/camera/seen")} == {
        "/map": 1,
        "/chat": 2,
        "/camera/seen": 1,
    }
    assert "/odd" not in found
    with file.open("rb") as data:
        reader = make_reader(data)
        assert [each.data for each in reader.iter_attachments()] == [b"text"]
        schemas = {schema.name: schema.data for schema, *_ in reader.iter_messages() if schema is not None}
    assert schemas["my_msgs/msg/Seen"] == b"string what\n"


def test_chosen_keys_alone(hub: MemoryHub, record: Callable[..., Callable[[], Path]]) -> None:
    """As key expressions."""
    end = record(keys=["robot_$*/**", "chat"])
    for key in ("chat", "robot_0/word", "other"):
        hub.bus().publisher(key, String).put(String("x"))
    assert topics(end()) == {"/chat": 1, "/robot_0/word": 1}


def test_the_last_seconds_alone(hub: MemoryHub, record: Callable[..., Callable[[], Path]]) -> None:
    """And before them the newest message of each latched key."""
    clock = hub.bus().publisher("clock", Clock)
    hub.bus().declare_token("sim/alive/51")
    end = record(clock="auto", last=2.0)
    for second in range(1, 6):
        clock.put(Clock(time_from_ns(second * 10**9)))
        hub.bus().publisher("chat", String).put(String(str(second)))
        if second < 3:
            hub.bus().publisher("tf_static", TFMessage, latched=True).put(TFMessage())
    assert topics(end()) == {"/clock": 3, "/chat": 3, "/tf_static": 1}


def test_an_older_recording_is_kept(record: Callable[..., Callable[[], Path]]) -> None:
    """Unless it is to be replaced."""
    record()()
    with pytest.raises(UsageError):
        record()()
    record(force=True)()


def test_a_full_disk_ends_the_recording_and_keeps_what_it_has(
    hub: MemoryHub,
    record: Callable[..., Callable[[], Path]],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """With an error of one line that says so, and exit code 1, also where it was asked to stop already."""
    end, is_full = record(code=1), threading.Event()

    def flush(_: writing.RecordingWriter) -> None:
        is_full.set()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(writing.RecordingWriter, "flush", flush)
    hub.bus().publisher("chat", String).put(String("x"))
    assert is_full.wait(LIMIT)
    end()
    assert [each.levelname for each in caplog.records if "No space left" in each.getMessage()] == ["ERROR"]


def test_what_cannot_be_recorded_ends_no_recording(hub: MemoryHub, record: Callable[..., Callable[[], Path]]) -> None:
    """A tick that cannot be read, a time that does not fit, and more types than anybody has."""
    end = record()
    stranger = hub.bus()
    stranger.declare_token(names.lockstep_key(stranger.instance))
    tick, kind = hub.bus().transport, "application/cdr;zteam_msgs/msg/Tick"
    stranger.transport.declare_publisher(names.TICK, kind, False).put(b"short")
    tick.declare_publisher(names.TICK, kind, False).put(b"short")
    stranger.publisher("clock", Clock).put(Clock(Time(-5)))
    for number in range(400):
        stranger.transport.declare_publisher("odd", f"application/cdr;my/msg/T{number}", False).put(b"")
    stranger.publisher("chat", String).put(String("all the same"))
    assert topics(end())["/chat"] == 1

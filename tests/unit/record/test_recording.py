"""Reading recordings: whole ones, those that were cut off, and what is none."""

import json
import random
import resource
import tempfile
from pathlib import Path
from typing import Any, ClassVar

import mcap.reader
import mcap.writer
import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.highlevel import AnyReader
from rosbags.interfaces import Qos
from rosbags.typesys import Stores, get_typestore

import zteam
from support.examples import examples
from support.hostile import damaged
from support.recorded import FACTS, STEP, assorted, drive, entry, write
from zteam.errors import UsageError, ZteamError
from zteam.messages import LaserScan, Message, Point, String, encode, float64, to_plain, uint8
from zteam.messages.message import REGISTERED, definition_of
from zteam.record.exporting import draw_tracks, write_copy, write_csv, write_ros2_bag
from zteam.record.recording import Recording
from zteam.record.writing import RecordingWriter

COUNT = 30


@pytest.fixture
def whole(tmp_path: Path) -> Path:
    """A finished recording."""
    return write(tmp_path / "run.mcap", assorted(COUNT), ticks="29")


def plain(value: Any) -> Any:
    """A message of rosbags as dicts and lists."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, list):
        return [plain(each) for each in value]
    fields = getattr(value, "__dataclass_fields__", None)
    return value if fields is None else {name: plain(getattr(value, name)) for name in fields if name != "__msgtype__"}


def read_by_rosbags(path: Path) -> list[tuple[str, int, Any]]:
    """Topic, time and plain message of all messages, by a reader that is not zteam's."""
    with AnyReader([path], default_typestore=get_typestore(Stores.EMPTY)) as reader:
        return [
            (connection.topic, time, plain(reader.deserialize(data, connection.msgtype)))
            for connection, time, data in reader.messages()
        ]


def test_messages_come_back(whole: Path) -> None:
    """Each message is what was recorded, with its time, and a key is found with or without its slash."""
    recording = zteam.Recording(whole)
    for key in ("robot_0/base_scan", "/clock", "sim/log"):
        found = [(time, encode(message)) for time, message in recording.messages(key)]
        assert found == [(each.time, each.data) for each in assorted(COUNT) if each.key == key.strip("/")]
    topic = recording.topics["clock"]
    assert (topic.type, topic.messages, topic.start) == ("rosgraph_msgs/msg/Clock", COUNT, STEP)


def test_a_table_has_a_column_for_each_field(whole: Path) -> None:
    """Numbers keep their type, nested fields have dotted names, arrays and texts are objects; all are of one length."""
    table = Recording(whole).table("robot_0/base_scan")
    assert list(table)[:4] == ["time_s", "header.stamp.sec", "header.stamp.nanosec", "header.frame_id"]
    assert {(column.ndim, len(column)) for column in table.values()} == {(1, COUNT)}
    assert table["time_s"][2] == pytest.approx(0.3) and table["header.stamp.nanosec"].dtype == np.uint32
    assert table["ranges"].dtype == object and table["ranges"][3].tolist() == [2.0] * 4
    assert table["header.frame_id"][0] == "robot_0/base_laser_link"


def test_poses_and_distances(tmp_path: Path) -> None:
    """Poses are seconds, metres and radians in `map`; the report adds up what each robot has driven."""
    recording = Recording(write(tmp_path / "run.mcap", drive(8), ticks="7", stray="mine notes"))
    assert recording.poses("robot_1") == pytest.approx(np.array([(0.1 * i, 0.1 * i, 1.0, 0.0) for i in range(1, 9)]))
    report = recording.report
    assert [(robot.id, robot.distance_m) for robot in report.robots] == [
        (0, pytest.approx(0.7)),
        (1, pytest.approx(0.7)),
    ]
    assert (report.seed, report.command, report.ticks, report.lockstep) == (3, FACTS["command"], 7, True)
    assert (report.is_whole, report.stray, report.seconds) == (True, {"mine": "notes"}, 0.8)
    with pytest.raises(UsageError, match="'bob' is no robot"):
        recording.poses("bob")


@pytest.mark.parametrize("directory", [False, True])
def test_rosbags_reads_every_message(tmp_path: Path, whole: Path, directory: bool) -> None:
    """A reader that knows no type of its own decodes each message to the same values, from the file and from a bag."""
    path = whole
    if directory:
        path = tmp_path / "bag"
        write_ros2_bag(Recording(whole), path)
    recording = Recording(whole)
    own = [
        (f"/{key}", time, to_plain(message)) for key in recording.topics for time, message in recording.messages(key)
    ]

    def ordered(found: list[tuple[str, int, Any]]) -> list[tuple[str, int, str]]:
        shown = [(topic, time, repr(to_plain(message))) for topic, time, message in found]
        return sorted((topic, time, text) for topic, time, text in shown)

    # float32 as rosbags has them: zteam shows their shortest decimals.
    assert ordered(read_by_rosbags(path)) == ordered(own)


def test_a_bag_names_the_quality_of_latched_topics(tmp_path: Path) -> None:
    """`ros2 bag play` offers a map to late subscribers: the directory and the file say transient local."""
    run = write(tmp_path / "run.mcap", [entry("map", String(), 0, 0), entry("clock", String(), 0, 0)])
    write_ros2_bag(Recording(run), tmp_path / "bag")
    for path in (run, tmp_path / "bag"):
        with AnyReader([path], default_typestore=get_typestore(Stores.EMPTY)) as reader:
            found: dict[str, list[Qos]] = {c.topic: c.ext.offered_qos_profiles for c in reader.connections}  # type: ignore[union-attr]
        assert {topic: each[0].durability.name for topic, each in found.items()} == {
            "/map": "TRANSIENT_LOCAL", "/clock": "VOLATILE",
        }  # fmt: skip


def test_a_schema_is_what_rosbags_generates(tmp_path: Path) -> None:
    """Each schema of a file is the text that rosbags makes of ROS 2's own type, without its constants."""
    store, compared = get_typestore(Stores.ROS2_JAZZY), 0
    for name, kind in REGISTERED.items():
        if name in store.fielddefs and not any(store.fielddefs[name][0]):
            text, _ = store.generate_msgdef(name, ros_version=2)
            fields = [line for line in text.splitlines() if line and "=" not in line.strip("=")]
            assert definition_of(kind).splitlines() == fields, name
            compared += 1
    assert compared > 20


@pytest.mark.parametrize("seed", range(5))
def test_a_file_that_was_cut_is_read_up_to_there(tmp_path: Path, seed: int) -> None:
    """Wherever it ends, all that was flushed before is read, and its copy opens with other readers."""
    path, entries = tmp_path / "cut.mcap", list(assorted(COUNT))
    writer = RecordingWriter(path, FACTS, {"launch.json": b"{}"}, force=False)
    begin = path.stat().st_size
    ends = []
    for i, each in enumerate(entries, 1):
        writer.put(each)
        if i % 10 == 0:
            writer.flush()
            ends.append((path.stat().st_size, i))
    writer.abandon()
    data, draw = path.read_bytes(), random.Random(seed)
    for size in (begin, len(data), *(draw.randrange(begin, len(data)) for _ in range(20))):
        path.write_bytes(data[:size])
        recording = Recording(path)
        found = list(recording.entries())
        # What lies behind a chunk's messages is an index.
        assert len(found) >= max((count for end, count in ends if end <= size), default=0)
        assert found == entries[: len(found)]
        assert not recording.is_finished and recording.report.is_whole is None
        copy = tmp_path / "copy.mcap"
        assert write_copy(recording, copy, force=True) == len(found)
        with copy.open("rb") as file:
            assert len(list(mcap.reader.make_reader(file).iter_messages())) == len(found)
        again = Recording(copy)
        assert again.is_finished and again.facts == recording.facts and again.contents == {"launch.json": b"{}"}
    # A host that went down has kept a file's size, but not its last bytes.
    path.write_bytes(data[: ends[1][0] + 100] + bytes(len(data)))
    assert len(list(Recording(path).entries())) == ends[1][1]
    path.write_bytes(data[: ends[1][0] + 100] + bytes(len(data) - ends[1][0] - 100))
    assert len(list(Recording(path).entries())) == ends[1][1]


def test_a_copy_is_the_recording(tmp_path: Path, whole: Path) -> None:
    """A copy of a finished file has the same messages in their ticks, attachments and facts; it does not replace it."""
    recording = Recording(whole)
    write_copy(recording, tmp_path / "copy.mcap")
    copy = Recording(tmp_path / "copy.mcap")
    assert list(copy.entries()) == list(recording.entries())
    assert (copy.facts, copy.end_facts, copy.contents) == (recording.facts, recording.end_facts, recording.contents)
    (tmp_path / "copy.mcap").write_bytes(whole.read_bytes()[:-1])
    assert not Recording(tmp_path / "copy.mcap").is_finished
    with pytest.raises(UsageError, match="choose another file"):
        write_copy(recording, whole, force=True)


def test_types_that_are_not_installed(tmp_path: Path) -> None:
    """A user's own type is read by the definition that the file has, and takes no name in this process."""

    class Mark(Message):
        ros_type: ClassVar[str] = "of_a_test/msg/Mark"
        at: list[Point] = msgspec.field(default_factory=list)
        names: list[str] = msgspec.field(default_factory=list)
        level: uint8 = 0
        weight: float64 = 0.0

    path, mark = tmp_path / "own.mcap", Mark([Point(1.0, 2.0)], ["a", "b"], 7, 0.5)
    write(path, [entry("marks", mark, 0, 5)])
    del REGISTERED[Mark.ros_type]
    ((time, found),) = Recording(path).messages("marks")
    assert (time, type(found).__name__, to_plain(found)) == (5, "Mark", to_plain(mark))
    assert Mark.ros_type not in REGISTERED


def test_a_type_of_another_version_and_one_that_is_not_read(tmp_path: Path) -> None:
    """The recorded definition counts, also for a type of zteam's own; one with other numbers is refused by its name."""
    path = tmp_path / "old.mcap"
    writer = RecordingWriter(path, FACTS, {}, force=False)
    writer.define(String.ros_type, "uint8 ONE=1 # no field\nuint8 data\n")
    writer.define("far/msg/Odd", "int16 data\n")
    writer.put(entry("one", String(), 0, 0)._replace(data=b"\0\1\0\0\7"))
    writer.put(entry("two", String(), 0, 0)._replace(type="far/msg/Odd"))
    writer.finish({})
    recording = Recording(path)
    assert [message.data for _, message in recording.messages("one")] == [7]
    with pytest.raises(UsageError, match="far/msg/Odd is not installed here"):
        list(recording.messages("two"))


def test_what_is_no_recording_is_refused_in_a_line(tmp_path: Path, whole: Path) -> None:
    """Nothing, another file, a directory, an MCAP of another program, and one with a damaged middle."""
    empty, text, foreign, damaged = (tmp_path / name for name in ("empty", "text", "foreign", "damaged"))
    empty.touch()
    text.write_text("no recording at all")
    with foreign.open("wb") as file:
        writer = mcap.writer.Writer(file)
        writer.start()
        writer.finish()  # type: ignore[no-untyped-call]
    data = bytearray(whole.read_bytes())
    data[len(data) // 3] ^= 255
    damaged.write_bytes(data)
    # Of what a chunk holds, no single bit may be another one.
    begin = whole.read_bytes().index(b"\x04\0\0\0zstd") + 16
    for place in range(begin, begin + 300, 7):
        data = bytearray(whole.read_bytes())
        data[place] ^= 1
        damaged.write_bytes(data)
        with pytest.raises(UsageError, match="damaged"):
            list(Recording(damaged).entries())
    for path, told in {
        empty: "empty", text: "no MCAP file", tmp_path: "directory", tmp_path / "no": "No such file",
        foreign: "no recording of zteam", damaged: "damaged",
    }.items():  # fmt: skip
        with pytest.raises(UsageError, match=told) as error:
            list(Recording(path).entries())
        assert str(path) in str(error.value) and "\n" not in str(error.value)


@examples(400)
@given(data=st.data())
def test_any_damage_is_read_or_refused(data: st.DataObject) -> None:
    """Of a damaged file all that is whole is read, or one line says that it cannot be; nothing else happens."""
    with tempfile.TemporaryDirectory() as folder:
        path = write(Path(folder) / "run.mcap", assorted(3))
        path.write_bytes(data.draw(damaged(st.just(path.read_bytes()))))
        try:
            recording = Recording(path)
            assert recording.report.messages == len(list(recording.entries()))
            for key in recording.topics:
                recording.table(key)
        except UsageError as error:
            assert str(path) in str(error) and "\n" not in str(error)


def test_a_disk_without_room_is_named_and_nothing_stays(tmp_path: Path, whole: Path) -> None:
    """A copy that does not fit is no file, from its first byte to its last; the error is one line."""
    size, again = whole.stat().st_size, tmp_path / "again.mcap"
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    for room in (10, size // 2, size - 10):
        with pytest.raises(ZteamError, match=rf"^{again}: cannot write.*: File too large$"):
            try:
                resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
                write_copy(Recording(whole), again)
            finally:
                resource.setrlimit(resource.RLIMIT_FSIZE, before)
        assert not again.exists()


def test_a_key_without_messages_is_named(whole: Path) -> None:
    """A mistyped key is answered with the one that was meant."""
    with pytest.raises(UsageError, match=r"no messages on robot_0/base_scam \(did you mean robot_0/base_scan\?\)"):
        Recording(whole).table("robot_0/base_scam")


def test_csv_files(tmp_path: Path, whole: Path) -> None:
    """Each key has a file with a line for each message; arrays are JSON, and a text keeps its line break."""
    import csv

    write_csv(Recording(whole), ["robot_0/base_scan", "sim/log"], tmp_path / "out")
    with (tmp_path / "out" / "robot_0.base_scan.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert (len(rows), rows[1]["time_s"], json.loads(rows[1]["ranges"])) == (COUNT, "0.2", [1.0, 1.0])
    with (tmp_path / "out" / "sim.log.csv").open(newline="", encoding="utf-8") as file:
        assert [row["data"] for row in csv.DictReader(file)][2] == "tick 3, a “text”\nof two lines"
    with pytest.raises(UsageError, match="exists"):
        write_csv(Recording(whole), ["sim/log"], tmp_path / "out")


def test_a_picture_shows_each_way(tmp_path: Path) -> None:
    """Each robot's way is a line from its first place to its last, in the picture's scale."""
    run = write(tmp_path / "run.mcap", drive(8))
    assert draw_tracks(Recording(run), tmp_path / "run.svg", width=340) == [0, 1]
    lines = [line for line in (tmp_path / "run.svg").read_text().splitlines() if line.startswith("<polyline")][:2]
    places = [[[float(n) for n in place.split(",")] for place in line.split('"')[1].split()] for line in lines]
    # 0.7 m of way and 0.5 m on both sides are 340 pixels.
    assert [len(each) for each in places] == [8, 8]
    assert places[0][-1][0] - places[0][0][0] == pytest.approx(140.0)
    assert places[0][0][1] - places[1][0][1] == pytest.approx(200.0)
    with pytest.raises(UsageError, match="no ground truth"):
        draw_tracks(Recording(write(tmp_path / "none.mcap", assorted(3))), tmp_path / "none.svg")


def test_what_is_no_message_is_left_out(tmp_path: Path) -> None:
    """A payload that another program has published on a key, or a message of another type, does not hide the others."""
    good = entry("robot_0/base_scan", LaserScan(), 0, 1)
    path = write(tmp_path / "run.mcap", [good, good._replace(data=b"garbage"), good, entry(good.key, String(), 0, 2)])
    assert len(Recording(path).table("robot_0/base_scan")["time_s"]) == 2

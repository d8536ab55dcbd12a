"""Other forms of a recording: a finished copy, a directory that `ros2 bag` opens, CSV files, and a picture."""

import copy
import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from zteam import names
from zteam.errors import UsageError, ZteamError
from zteam.geometry import Pose2, yaw_from_quaternion
from zteam.messages import OccupancyGrid, to_plain
from zteam.messages.topics import is_latched
from zteam.record.recording import Recording
from zteam.record.writing import RecordingWriter, qos_profiles


def write_copy(recording: Recording, path: Path, *, force: bool = False) -> int:
    """Write a finished copy of a recording; return how many messages it has.

    Raises UsageError where the file exists, unless `force`, and ZteamError where it cannot be written.
    """
    if path.exists() and path.samefile(recording.path):
        raise UsageError(f"{path} is what is read: choose another file")
    writer = RecordingWriter(path, recording.facts, recording.contents, force=force)
    newest = 0
    try:
        for entry in recording.entries():
            writer.define(entry.type, recording.definitions[entry.type])
            writer.put(entry)
            newest = max(newest, entry.tick)
        writer.finish(recording.end_facts or {"ticks": str(max(0, newest - 1)), "recovered": str(True)})
    except BaseException as error:
        writer.abandon()
        path.unlink()
        if isinstance(error, OSError):
            raise ZteamError(f"{path}: cannot write: {error.strerror}") from None
        raise
    return writer.count


def write_ros2_bag(recording: Recording, folder: Path, *, force: bool = False) -> int:
    """Write a directory as `ros2 bag` has it: a finished copy, and `metadata.yaml` beside it; return how many messages.

    Raises UsageError where the directory has such files, unless `force`, and ZteamError where it cannot be written.
    """
    import yaml

    path = _made(folder) / f"{folder.resolve().name}.mcap"
    count = write_copy(recording, path, force=force)
    topics = [
        {
            "topic_metadata": {
                "name": f"/{key}",
                "type": topic.type,
                "serialization_format": "cdr",
                "offered_qos_profiles": qos_profiles(latched=is_latched(key)),
            },
            "message_count": topic.messages,
        }
        for key, topic in recording.topics.items()
    ]
    start, end = recording.span
    span = {
        "starting_time": {"nanoseconds_since_epoch": start},
        "duration": {"nanoseconds": end - start},
        "message_count": count,
    }
    # Version 5 is that of Humble, which newer readers convert; later versions have other names for the qualities.
    facts = {
        "version": 5,
        "storage_identifier": "mcap",
        "relative_file_paths": [path.name],
        **span,
        "topics_with_message_count": topics,
        "compression_format": "",
        "compression_mode": "",
        "files": [{"path": path.name, **copy.deepcopy(span)}],
    }
    text = yaml.safe_dump({"rosbag2_bagfile_information": facts}, sort_keys=False)
    _write(folder / "metadata.yaml", text, force=force)
    return count


def write_csv(recording: Recording, keys: Iterable[str], folder: Path, *, force: bool = False) -> list[Path]:
    """Write the table of each key into a file such as `robot_0.odom.csv`; return the files.

    Arrays, lists and messages in a column are JSON. Raises as `write_ros2_bag`, and UsageError for an unknown key.
    """
    written = []
    for key in keys:
        table = recording.table(key)
        columns = [map(_cell, column.tolist()) for column in table.values()]
        path = _made(folder) / f"{key.replace('/', '.')}.csv"
        with _open(path, force=force) as file:
            try:
                writer = csv.writer(file)
                writer.writerow(table)
                writer.writerows(zip(*columns, strict=True))
            except OSError as error:
                raise ZteamError(f"{path}: cannot write: {error.strerror}") from None
        written.append(path)
    return written


def draw_tracks(recording: Recording, path: Path, *, width: int = 1200) -> list[int]:
    """Draw the ways of all robots by their ground truth into an .svg or .png file, on the newest map that the recording
    has; return their ids. Raises UsageError where it has no ground truth, or the file cannot be written."""
    from zteam.simulator.world.drawing import draw_world
    from zteam.simulator.world.model import Floorplan, World

    robot_ids = [robot.id for robot in recording.report.robots if robot.distance_m is not None]
    if not robot_ids:
        raise UsageError(f"{recording.path} has no ground truth of a robot: only a simulated run can be drawn")
    plans = []
    if names.MAP in recording.topics:
        grid: OccupancyGrid
        *_, (_, grid) = recording.messages(names.MAP)
        info, q = grid.info, grid.info.origin.orientation
        pose = Pose2(info.origin.position.x, info.origin.position.y, yaw_from_quaternion(q.x, q.y, q.z, q.w))
        occupied = np.asarray(grid.data).reshape(info.height, info.width) > 50
        plans.append(Floorplan(names.MAP, occupied, (info.resolution,) * 2, pose, 0.0, 1.0, color="gray50"))
    world = World(recording.path.name, 1, tuple(plans), (), ())
    draw_world(world, path, width=width, tracks={each: recording.poses(each)[:, 1:3] for each in robot_ids})
    return robot_ids


def _cell(value: Any) -> Any:
    return value if isinstance(value, str | int | float) else msgspec.json.encode(to_plain(value)).decode()


def _made(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder}: cannot make this directory: {error.strerror}") from None
    return folder


def _open(path: Path, *, force: bool) -> Any:
    try:
        return path.open("w" if force else "x", newline="", encoding="utf-8")
    except FileExistsError:
        raise UsageError(f"{path} exists: choose another directory, or say --force to replace it") from None
    except OSError as error:
        raise UsageError(f"{path}: cannot write: {error.strerror}") from None


def _write(path: Path, text: str, *, force: bool) -> None:
    with _open(path, force=force) as file:
        try:
            file.write(text)
        except OSError as error:
            raise ZteamError(f"{path}: cannot write: {error.strerror}") from None

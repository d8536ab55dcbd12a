"""The monitor's table as text of a given width: one row a robot, and below it why the robot stands."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import msgspec

from zteam import names
from zteam.geometry import Pose2
from zteam.messages import RobotDriver, RobotState
from zteam.nodes.monitor.members import Member, printable
from zteam.nodes.monitor.team import Team
from zteam.numbers import counted

_HEAD = ("robot", "state", "behaviour", "x", "y", "yaw", "m/s", "age")
_LEFT = 3
"""Columns of text; the others are numbers."""
_BEHAVIOR_WIDTH = 20
_GAP = 2


class Row(msgspec.Struct):
    """One robot."""

    robot: str
    state: str
    """A state of its own (`RobotState`), or `lost`, `silent`, `absent`, which the monitor sees."""
    behavior: str = ""
    pose: Pose2 | None = None
    """Metres and radians in `map`."""
    speed: float | None = None
    """Of its newest command, m/s."""
    age: float | None = None
    """Host seconds since its newest status."""
    reason: str = ""
    """Why it stands, or is not there."""
    restarts: int = 0
    """How often its process was started again."""


class Line(NamedTuple):
    """One line of the table."""

    text: str
    state: str = ""
    """The state in it, which a terminal shows in a colour; empty in other lines."""


def make_rows(team: Team, poses: Mapping[int, Pose2], restarts: Mapping[str, int], now: float) -> list[Row]:
    """The robots at host time `now`; `restarts` by the process's name. The caller holds the team's lock."""
    rows = [_row(i, member, poses.get(i), now) for i, member in sorted(team.members.by_id.items())]
    for row in rows:
        row.restarts = restarts.get(row.robot, 0)
    return rows


def _row(robot_id: int, member: Member, pose: Pose2 | None, now: float) -> Row:
    row = Row(names.robot_name(robot_id), _state(member), pose=pose)
    status = member.status
    if status is None:
        row.reason = member.why_not_ready
        return row
    row.behavior = printable(_behavior(status.behavior, status.followed, status.driver))
    row.age = now - member.heard
    row.speed = status.speed
    if member.silent:
        row.reason = member.why_not_ready
        return row
    if status.state == RobotState.READY:
        # What GO waits for stands below the table.
        return row
    # A robot of an older version says only in its text why it does not drive.
    reason = status.reason or ("" if status.state == RobotState.RUNNING else status.text)
    row.reason = printable((member.absence or reason) if reason else "")
    return row


def _state(member: Member) -> str:
    if member.was_lost:
        return "stopped" if member.stopped else "lost"
    if member.silent:
        return "silent"
    return "absent" if member.status is None else RobotState.TEXT[min(member.status.state, RobotState.FAULT)]


def _behavior(behavior: str, leader: int, driver: str) -> str:
    text = behavior if leader < 0 else f"{behavior} {names.robot_name(leader)}"
    return text if driver in (RobotDriver.BEHAVIOR, RobotDriver.NONE, "") else f"{driver} ({text})"


def format_table(rows: Sequence[Row], notes: Sequence[str], width: int) -> list[Line]:
    """The table in lines of at most `width` characters; `notes` stand below it."""
    cells = [_HEAD, *(_cells(row) for row in rows)]
    widths = [max(len(line[column]) for line in cells) for column in range(len(_HEAD))]
    lines = [Line(_join(_HEAD, widths))]
    for row, texts in zip(rows, cells[1:], strict=True):
        text = _join(texts, widths)
        if row.reason and len(text) + _GAP + len(row.reason) <= width:
            lines.append(Line(f"{text}{' ' * _GAP}{row.reason}", row.state))
            continue
        lines.append(Line(text, row.state))
        lines += [Line(part) for part in _wrap(row.reason, width, " " * (widths[0] + _GAP))]
    return lines + [Line(part) for note in notes for part in _wrap(printable(note), width, "")]


def _cells(row: Row) -> tuple[str, ...]:
    pose = ("-", "-", "-") if row.pose is None else tuple(f"{value:.2f}" for value in row.pose)
    behavior = row.behavior if len(row.behavior) <= _BEHAVIOR_WIDTH else row.behavior[: _BEHAVIOR_WIDTH - 1] + "…"
    speed = "-" if row.speed is None else f"{row.speed:.2f}"
    return row.robot, row.state, behavior or "-", *pose, speed, "-" if row.age is None else f"{row.age:.1f} s"


def _join(cells: Sequence[str], widths: Sequence[int]) -> str:
    aligned = [
        cell.ljust(size) if column < _LEFT else cell.rjust(size)
        for column, (cell, size) in enumerate(zip(cells, widths, strict=True))
    ]
    return (" " * _GAP).join(aligned).rstrip()


def _wrap(text: str, width: int, indent: str) -> list[str]:
    return textwrap.wrap(text, max(width, len(indent) + 20), initial_indent=indent, subsequent_indent=indent)


def team_notes(team: Team, restarts: Mapping[str, int], problems: Sequence[str]) -> list[str]:
    """The lines below the table: GO, or what it waits for, processes started again, and what else is wrong."""
    again = [f"{name} {counted(count, 'time')}" for name, count in sorted(restarts.items())]
    told = [f"started again: {', '.join(again)}"] if again else []
    return ["GO is out" if team.gone else f"waiting for {team.waiting_for()}", *told, *problems]

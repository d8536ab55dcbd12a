"""The simulator's status as text."""

from collections.abc import Sequence

from zteam.clock import to_seconds
from zteam.robot_ids import format_robot_ids
from zteam.services.simulator import SimStatus


def format_status(status: SimStatus) -> str:
    """The simulator's status as a table, one line per value."""
    paused = "run over" if status.finished else "yes" if status.paused else "no"
    rows = [
        ("world", f"{status.world}, seed {status.seed}"),
        ("time", f"{to_seconds(status.now):.3f} s"),
        ("tick", f"{status.tick}, {status.interval / 1e6:g} ms each"),
        ("speed", format_pace(status)),
        ("real-time factor", f"{status.real_time_factor:.3g}"),
        ("paused", paused),
        ("lock-step", "yes" if status.lockstep else "no"),
    ]
    if status.lockstep:
        rows += [
            ("  participants", _listed(status.participants)),
            ("  joining", _listed(status.joining)),
            ("  waiting for", status.waiting_for or "-"),
            ("  hung", _listed(status.hung)),
        ]
    rows.append(("robots", format_robot_ids(status.robots) or "-"))
    return "\n".join(f"{name:18}{value}" for name, value in rows)


def format_when(status: SimStatus) -> str:
    """The time of the world, and its tick."""
    return f"at {to_seconds(status.now):.3f} s (tick {status.tick})"


def format_hold(status: SimStatus) -> str:
    """What holds a tick of lock-step, as the end of a sentence; empty if nothing does."""
    return f", which waits for {status.waiting_for}" if status.waiting_for else ""


def format_pace(status: SimStatus) -> str:
    """The speed that was asked for."""
    if status.speed is None:
        return "as fast as possible"
    return f"{status.speed:g} simulated second{'s' * (status.speed != 1.0)} a second"


def _listed(items: Sequence[object]) -> str:
    return ", ".join(map(str, items)) or "-"

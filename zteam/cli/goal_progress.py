"""A goal on its way, for users and for scripts: one live line, or a line now and then; and how it ended."""

import math
import sys
from types import TracebackType
from typing import Any

import msgspec

from zteam.cli.live_line import LiveLine, has_live_line
from zteam.cli.progress_text import duration_text
from zteam.clock import Every, monotonic
from zteam.geometry import yaw_from_quaternion
from zteam.messages import Duration, NavigationState
from zteam.numbers import counted
from zteam.services.navigation import GoalWatch, NavigationClient, TaskResult, goal_text

_PERIOD = 5.0
"""Host seconds between two lines where one cannot be rewritten."""
_PATIENCE = 2.0
"""Host seconds after which it says what it waits for."""


class Progress:
    """Shows one goal on standard error while it lasts. A context manager."""

    def __init__(self, client: NavigationClient) -> None:
        self._client = client
        self._live = LiveLine(sys.stderr) if has_live_line(sys.stderr) else None
        self._due = Every(_PERIOD)
        self._due.due()
        self._since = monotonic()
        self._told = ""

    def __enter__(self) -> "Progress":
        if self._live is not None:
            self._live.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.__exit__(kind, error, trace)

    def say(self, text: str) -> None:
        """Print a line."""
        if self._live is None:
            print(text, file=sys.stderr, flush=True)
        else:
            self._live.print(text)

    def show(self, watch: GoalWatch) -> None:
        """Show how far the robot is, if it is time to."""
        waits = self._client.waits_for
        if waits and waits != self._told and monotonic() - self._since > _PATIENCE:
            self._told = waits
            self.say(f"waiting for {waits} (Ctrl+C to give up)")
        line = f"{self._client.name}: {progress_text(self._client, watch)}"
        if self._live is not None:
            self._live.show(lambda columns: line[:columns])
        elif watch.status is not None and self._due.due():
            self.say(line)


def seconds_of(duration: Duration) -> float:
    """A message's duration in seconds."""
    return duration.sec + duration.nanosec / 1e9


def state_text(client: NavigationClient, watch: GoalWatch) -> str:
    """What the robot does for this goal, in a word or two."""
    if watch.ended:
        return watch.result.name.lower()
    if client.is_pending:
        return "waiting"
    if watch.status is None:
        return "sent"
    try:
        return NavigationState(watch.status.state).name.lower()
    except ValueError:
        # Of a newer navigation.
        return f"state {watch.status.state}"


def progress_text(client: NavigationClient, watch: GoalWatch) -> str:
    """How far it is: state, metres and time that are left, recoveries, and why it does not get on."""
    if client.is_pending:
        return f"waiting for {client.waits_for}"
    parts = [state_text(client, watch)]
    status = watch.status
    if status is not None:
        if math.isfinite(status.distance_remaining):
            parts.append(f"{status.distance_remaining:.1f} m left")
        left = seconds_of(status.estimated_time_remaining)
        if left > 0.0:
            parts.append(f"about {duration_text(left)}")
        if status.recoveries:
            parts.append(counted(status.recoveries, "recovery", "recoveries"))
        if status.text:
            parts.append(status.text)
    return ", ".join(parts)


def result_text(client: NavigationClient, watch: GoalWatch, seconds: float) -> str:
    """How it ended, on one line."""
    place, status = goal_text(watch.goal), watch.status
    if not watch.ended:
        return f"{client.name}: goal sent: {place}"
    ends = {TaskResult.SUCCEEDED: "reached", TaskResult.CANCELED: "canceled", TaskResult.FAILED: "aborted"}
    why = f": {watch.text}" if watch.text and watch.result != TaskResult.SUCCEEDED else ""
    recoveries = f", {counted(status.recoveries, 'recovery', 'recoveries')}" if status and status.recoveries else ""
    return f"{client.name}: goal {ends[watch.result]} after {seconds:.1f} s{recoveries}: {place}{why}"


def goal_facts(client: NavigationClient, watch: GoalWatch, seconds: float) -> dict[str, Any]:
    """How it ended, for scripts."""
    place, turn, status = watch.goal.pose.position, watch.goal.pose.orientation, watch.status
    return {
        "robot": client.robot_id,
        "goal": {"x": place.x, "y": place.y, "yaw": yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w)},
        "result": watch.result.name.lower() if watch.ended else "sent",
        "text": watch.text,
        "seconds": round(seconds, 3),
        "recoveries": status.recoveries if status else 0,
        "distance_remaining": status.distance_remaining if status else None,
        "driven_by": client.taker,
    }


def goal_report(client: NavigationClient, watch: GoalWatch, seconds: float) -> str:
    """`goal_facts` as JSON."""
    return msgspec.json.encode(goal_facts(client, watch, seconds)).decode()

"""Tokens and statuses of robots for a start gate, and the lines that it tells."""

from zteam.messages import RobotState, RobotStatus
from zteam.monitor.process.start_gate import Gate

READY, RUNNING, BOOT, STOPPED, FAULT = (
    RobotState.READY,
    RobotState.RUNNING,
    RobotState.BOOT,
    RobotState.STOPPED,
    RobotState.FAULT,
)


def status(robot_id: int, state: int = READY, epoch: int = 0, text: str = "") -> RobotStatus:
    """The status of robot `robot_id` in this state."""
    return RobotStatus(robot_id=robot_id, is_ready=state in (READY, RUNNING), state=state, epoch=epoch, text=text)


def come(gate: Gate, *robot_ids: int, state: int = READY, epoch: int = 0, now: float = 0.0) -> None:
    """Processes take these names and publish their state."""
    for robot_id in robot_ids:
        gate.on_token(robot_id, True)
        gate.on_status(robot_id, status(robot_id, state, epoch), now)


def told(gate: Gate, *kinds: str) -> list[str]:
    """Lines of the events since the last call, of these kinds or all."""
    events = gate.take_events()
    return [("" if e.robot is None else f"robot_{e.robot} ") + e.text for e in events if not kinds or e.kind in kinds]

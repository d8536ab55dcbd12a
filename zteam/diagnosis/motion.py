"""Why a team does not drive: the world stands, the gate waits, a robot is not ready."""

from collections.abc import Mapping

from zteam import names
from zteam.clock import to_seconds
from zteam.diagnosis.facts import Facts
from zteam.diagnosis.finding import Finding, note, problem
from zteam.messages import RobotState, RobotStatus, TeamState
from zteam.numbers import counted
from zteam.robot_ids import format_robot_ids


def stands_still(facts: Facts) -> bool:
    """Whether the simulator sends no data: the world stands, or the simulator does not answer."""
    sim = facts.sim
    if sim is None:
        return names.SIMULATOR in facts.alive
    return sim.paused or sim.finished or is_held(facts)


def is_held(facts: Facts) -> bool:
    """Whether participants of lock-step hold the world."""
    sim = facts.sim
    return sim is not None and sim.lockstep and facts.holds and bool(sim.waiting_for)


def check_world(facts: Facts) -> list[Finding]:
    """Whether the world stands still, and why."""
    sim = facts.sim
    if sim is None:
        return []
    when = f"at {to_seconds(sim.now):.3f} s (tick {sim.tick})"
    if is_held(facts):
        return [problem("world", f"lock-step is held {when}: it waits for {sim.waiting_for}", _hold_step(facts))]
    if sim.finished:
        return [note("world", f"the run is over {when}: the world stands still", "zteam sim reset")]
    if sim.paused:
        return [problem("world", f"the simulator is paused {when}", "zteam sim resume")]
    return []


def _hold_step(facts: Facts) -> str:
    waited = facts.sim.waiting_for.split(", ") if facts.sim else []
    absent = [name for name in waited if name not in facts.alive and " " not in name]
    if absent:
        robot_id = names.robot_id_of(absent[0])
        return f"start {absent[0]}" if robot_id is None else f"zteam-robot --id {robot_id}"
    if waited and waited[0] in facts.alive:
        return f"look at the log of {waited[0]}; it is left behind after --lockstep-timeout, or end it"
    return "start the monitor, and the robots that it waits for"


def check_gate(facts: Facts) -> list[Finding]:
    """What the gate waits for, and which robots the monitor has lost."""
    team = facts.team
    if team is None or names.MONITOR not in facts.alive:
        return []
    found = []
    if team.state == TeamState.WAITING:
        missing = [int(i) for i in team.missing]
        awaited = team.waiting_for or ", ".join(map(names.robot_name, missing))
        awaited = awaited or f"{team.team_size - len(team.ready)} more of any id"
        text = f"the start gate waits for {awaited} ({len(team.ready)} of {team.team_size} ready)"
        found.append(problem("gate", text, _gate_step(facts, missing)))
    lost = [int(i) for i in team.lost if int(i) not in facts.robots and (facts.sim is None or i in facts.sim.robots)]
    if lost:
        gone = ", ".join(map(names.robot_name, lost))
        text = f"the process of {gone} was there and is gone: it has ended, or is stopped (Ctrl+Z)"
        found.append(problem("gate", text, f"start it again: zteam-robot --id {lost[0]}, with its behaviour"))
    return found


def _gate_step(facts: Facts, missing: list[int]) -> str:
    there = None if facts.sim is None else facts.sim.robots
    lacking = [i for i in missing if there is not None and i not in there]
    if there is not None and lacking:
        has = format_robot_ids(there)
        return f"the world has no robot {format_robot_ids(lacking)}: zteam-monitor --ids {has.replace(', ', ',')}"
    absent = [i for i in missing if i not in facts.robots]
    if absent:
        return f"zteam-robot --id {absent[0]}"
    if missing:
        return "see what these robots wait for"
    team_size = facts.team.team_size if facts.team else 0
    most = max(len(facts.robots), len(there or ()))
    if there is not None and most < team_size:
        return f"the world has {counted(most, 'robot')}: zteam-monitor --team-size {most}, or zteam sim spawn"
    return "start further robots: zteam-robot --id N"


def check_readiness(facts: Facts) -> list[Finding]:
    """Robots that are not ready, with what they wait for, and robots that failed."""
    found = []
    for robot_id, status in sorted(facts.statuses.items()):
        lacks_body = facts.sim is not None and robot_id not in facts.sim.robots
        name = names.robot_name(robot_id)
        if name not in facts.alive or lacks_body:
            # Both are told already, and are the cause.
            continue
        if status.state == RobotState.BOOT:
            text = f"{name} is not ready (boot): {status.text or 'it says no reason'}"
            found.append(problem("robots", text, _boot_step(facts, status)))
        elif status.state == RobotState.FAULT:
            found.append(
                problem("robots", f"{name} has failed: {status.text}", f"see its log, then start {name} again")
            )
        elif status.state == RobotState.RUNNING and (reason := status.reason or status.text):
            found.append(note("robots", f"{name} stands: {reason}"))
    return found


def check_frames(facts: Facts) -> list[Finding]:
    """Robots that stand and have no pose in `map`, with the transform that lacks."""
    found = []
    for robot_id in facts.robots if facts.frames is not None else ():
        status = facts.statuses.get(robot_id)
        gap = _gap(facts.frames or {}, robot_id)
        if gap is None or (status is not None and status.speed) or (facts.sim and robot_id not in facts.sim.robots):
            continue
        parent, child = gap
        tf, fixed = (names.robot_key(robot_id, topic) for topic in (names.TF, names.TF_STATIC))
        said = f"{fixed} or {tf}" if parent == names.MAP_FRAME else tf
        text = f"{names.robot_name(robot_id)} has no pose in map: no process says {parent} -> {child}"
        found.append(problem("transforms", text, f"it is due on {said}: see 'zteam topic info {said.split()[0]}'"))
    return found


def _gap(frames: Mapping[str, str], robot_id: int) -> tuple[str, str] | None:
    """The transform (parent, child) that lacks between `map` and a robot's base; None if they are connected."""
    odom, frame = (names.robot_frame(robot_id, name) for name in (names.ODOM, names.BASE_FOOTPRINT))
    if frame not in frames:
        return odom, frame
    while frame in frames:
        frame = frames[frame]
    return None if frame == names.MAP_FRAME else (names.MAP_FRAME, frame)


def _boot_step(facts: Facts, status: RobotStatus) -> str:
    if "pose" in status.text and names.AGGREGATOR not in facts.alive:
        return "zteam-tf"
    if stands_still(facts):
        return "its data comes when the world goes on"
    if facts.sim is None:
        return "start what publishes its data: zteam-sim WORLD, or the driver of a real base"
    return f"'zteam topic info {names.scan_key(status.robot_id, 0)}' names the publishers of its scans"


def check_silence(facts: Facts) -> list[Finding]:
    """Robots whose processes answer, but whose main loops publish nothing."""
    found = []
    for node in facts.nodes:
        robot_id = names.robot_id_of(node.name)
        if robot_id is None or not node.pid or robot_id in facts.statuses:
            continue
        text = f"{node.name} is alive but publishes no status: its behaviour hangs"
        found.append(problem("process", text, f"look at its behaviour, then end process {node.pid} on {node.host}"))
    return found

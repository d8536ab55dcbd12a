"""Whether the processes of a team are there, answer, and belong to robots of the world."""

from collections.abc import Sequence

from zteam import names
from zteam.diagnosis.facts import Facts
from zteam.diagnosis.finding import Finding, note, ok, problem
from zteam.launch import kinds
from zteam.messages import RobotState
from zteam.robot_ids import format_robot_ids

_SHOWN = 6
"""Processes of another namespace or router that are named."""


def check_elsewhere(facts: Facts) -> list[Finding]:
    """Whether processes that are missing here run in another namespace, or at another router of this machine."""
    found = [] if facts.nodes or not facts.elsewhere else [_of_namespaces(facts)]
    tell = note if facts.nodes or facts.elsewhere else problem
    for endpoint, processes in sorted(facts.routers.items()):
        text = f"another router of this machine, at {endpoint}, has processes: {_listed(processes)}"
        found.append(tell("router", text, f"--connect {endpoint} (or export ZTEAM_CONNECT={endpoint})"))
    return found


def _of_namespaces(facts: Facts) -> Finding:
    here = f"in the namespace {facts.namespace!r}" if facts.namespace else "outside of namespaces"
    places = [f"{_place(name)}: {_listed(found)}" for name, found in sorted(facts.elsewhere.items())]
    first = min(facts.elsewhere)
    step = f"--namespace {first}" if first else "--namespace '' (and unset ZTEAM_NAMESPACE)"
    return problem("namespace", f"no process is {here}; there are processes {'; '.join(places)}", step)


def _place(namespace: str) -> str:
    return f"in the namespace {namespace!r}" if namespace else "outside of namespaces"


def _listed(found: Sequence[str]) -> str:
    items = sorted(found)
    more = f" and {len(items) - _SHOWN} more" if len(items) > _SHOWN else ""
    return ", ".join(items[:_SHOWN]) + more


def check_processes(facts: Facts) -> list[Finding]:
    """One finding per kind of process, and one for every process that does not answer."""
    findings = [_of_kind(kind, facts) for kind in kinds.KINDS if kind.on_bus and not kind.beside]
    findings = [finding for finding in findings if finding.good or finding.next_step]
    for node in facts.nodes:
        if not node.pid:
            text = f"{node.name} is alive but does not answer: it is stopped (Ctrl+Z, SIGSTOP) or hangs"
            step = "continue it ('fg', 'kill -CONT PID') or end it; its name is free when its lease has run out"
            findings.append(problem("process", text, step))
    return findings


def _of_kind(kind: kinds.Kind, facts: Facts) -> Finding:
    """Whether processes of a kind are alive; bad without a next step where the team can work without them."""
    per_robot = kind.robot_id_of
    found = sorted(filter(kind.includes, facts.alive), key=per_robot and (lambda name: per_robot(name) or 0))
    if found:
        return ok(kind.title, "alive" if per_robot is None else ", ".join(found))
    text = f"no process {kind.name}" if per_robot is None else "none"
    if kind.name == names.AGGREGATOR:
        text += _followers(facts)
    # A team of fewer robots than the world has would leave some of them without GO.
    in_world = len(facts.sim.robots) if facts.sim else 0
    step = kind.hint.format(robots=max(1, len(facts.robots), in_world))
    works = _works_without(kind, facts)
    return note(kind.title, f"{text}: {works}", step) if works and step else problem(kind.title, text, step)


def _works_without(kind: kinds.Kind, facts: Facts) -> str:
    """Why the team works without a kind of process; empty if it does not."""
    if kind.name == names.SIMULATOR and any(names.scan_key(robot_id, 0) in facts.writers for robot_id in facts.robots):
        return "the robots get scans of other processes"
    if kind.name == names.MONITOR and facts.statuses:
        running = all(status.state == RobotState.RUNNING for status in facts.statuses.values())
        return "all robots run, but their health is not watched" if running else ""
    return ""


def _followers(facts: Facts) -> str:
    """What the missing transforms stop."""
    pairs = [f"robot_{i} follows robot_{s.leader}" for i, s in sorted(facts.statuses.items()) if s.leader >= 0]
    return f": {', '.join(pairs)} and cannot without transforms" if pairs else ""


def check_robots_of_world(facts: Facts) -> list[Finding]:
    """Processes of robots that the world lacks, and robots of the world without one."""
    if facts.sim is None:
        return []
    there = facts.sim.robots
    known = format_robot_ids(there) or "none"
    found = []
    for robot_id in sorted(set(facts.robots) - set(there)):
        text = (
            f"robot_{robot_id} has a process, but the world {facts.sim.world} has no robot {robot_id} (it has {known})"
        )
        step = f"zteam sim spawn --id {robot_id} --pose X Y YAW, or start zteam-robot with an id of the world"
        found.append(problem("robots", text, step))
    idle = [i for i in there if i not in facts.robots and names.robot_key(i, names.CMD_VEL) not in facts.writers]
    if idle and facts.alive & {names.MONITOR, *map(names.robot_name, there)}:
        noun = "robot" if len(idle) == 1 else "robots"
        text = f"no process drives {noun} {format_robot_ids(idle)} of the world"
        found.append(note("robots", text, f"zteam-robot --id {idle[0]}"))
    return found

"""All checks of a team, in the order in which they are told: causes come before what follows from them."""

from collections.abc import Iterator, Mapping, Sequence

from zteam import names
from zteam.bus.lateness import CLOCKS_APART, LATE
from zteam.bus.receiving import KeyCount
from zteam.clock import APART, to_seconds
from zteam.config.numbers import counted
from zteam.config.robot_ids import format_robot_ids
from zteam.errors import did_you_mean
from zteam.messages import RobotState, RobotStatus, TeamState
from zteam.messages.topics import has_one_writer, is_sensed, type_of_key
from zteam.monitor.doctor.facts import Facts, Finding, note, ok, problem
from zteam.monitor.doctor.maps import check_map
from zteam.monitor.followers import FollowProblem, follow_problems
from zteam.node import kinds


def check_world(facts: Facts) -> Iterator[Finding]:
    sim = facts.sim
    if sim is None:
        return
    when = f"at {to_seconds(sim.now):.3f} s (tick {sim.tick})"
    if facts.is_held:
        yield problem("world", f"lock-step is held {when}: it waits for {sim.waiting_for}", _hold_step(facts))
    elif sim.finished:
        yield note("world", f"the run is over {when}: the world stands still", "zteam sim reset")
    elif sim.paused:
        yield problem("world", f"the simulator is paused {when}", "zteam sim resume")


def _hold_step(facts: Facts) -> str:
    waited = facts.sim.silent if facts.sim else []
    for name in waited:
        if name not in facts.alive:
            robot_id = names.robot_id_of(name)
            return f"start {name}" if robot_id is None else f"zteam-robot --id {robot_id}"
    if waited:
        return f"look at the log of {waited[0]}; it is left behind after --lockstep-timeout, or end it"
    return "start the monitor, and the robots that it waits for"


def check_gate(facts: Facts) -> Iterator[Finding]:
    """What the gate waits for, and which robots the monitor has lost."""
    team = facts.team
    if team is None or names.MONITOR not in facts.alive:
        return
    if team.state == TeamState.WAITING:
        missing = team.missing.tolist()
        # Why each of them is not ready is told below.
        awaited = ", ".join(map(names.robot_name, missing)) or f"{team.team_size - len(team.ready)} more of any id"
        text = f"the start gate waits for {awaited} ({len(team.ready)} of {team.team_size} ready)"
        yield problem("gate", text, _gate_step(facts, missing))
    lost = [i for i in team.lost.tolist() if i not in facts.robots and not facts.lacks(i)]
    if lost:
        gone = ", ".join(map(names.robot_name, lost))
        text = f"the process of {gone} was there and is gone: it has ended, or is stopped (Ctrl+Z)"
        yield problem("gate", text, f"start it again: zteam-robot --id {lost[0]}, with its behaviour")


def _gate_step(facts: Facts, missing: list[int]) -> str:
    there = None if facts.sim is None else facts.sim.robots
    lacking = [i for i in missing if facts.lacks(i)]
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


def check_stops(facts: Facts) -> Iterator[Finding]:
    """Robots that `zteam stop` holds, by their own word or that of the simulator, which has their bodies."""
    held = set(facts.sim.stopped if facts.sim else ())
    held |= {i for i, status in facts.statuses.items() if status.is_stopped and i in facts.robots}
    if held:
        text = f"'zteam stop' holds robot{'s' * (len(held) > 1)} {format_robot_ids(held)}"
        yield problem("stop", text, "zteam stop --release")


def check_readiness(facts: Facts) -> Iterator[Finding]:
    """Robots that are not ready, with what they wait for, and robots that failed."""
    for robot_id, status in sorted(facts.statuses.items()):
        name = names.robot_name(robot_id)
        if name not in facts.alive or facts.lacks(robot_id):
            # Both are told already, and are the cause.
            continue
        if status.state == RobotState.BOOT:
            text = f"{name} is not ready (boot): {status.text or 'it says no reason'}"
            yield problem("robots", text, _boot_step(facts, status))
        elif status.state == RobotState.FAULT:
            yield problem("robots", f"{name} has failed: {status.text}", f"see its log, then start {name} again")
        elif status.state == RobotState.RUNNING and not status.is_stopped and (reason := status.reason or status.text):
            yield note("robots", f"{name} stands: {reason}")


def check_strays(facts: Facts) -> Iterator[Finding]:
    """Programs that publish transforms past the aggregator. A node of zteam may: its frames may be of no robot."""
    writers = {writer for key in (names.TF, names.TF_STATIC) for writer in facts.writers.get(key, ())}
    if strays := sorted(writers - facts.alive):
        publish = f"publish{'es' * (len(strays) == 1)} on tf or tf_static"
        text = f"{', '.join(strays)} {publish}: transforms of a robot are due on robot_N/tf and robot_N/tf_static"
        yield problem("transforms", text, "give each zenoh-bridge-ros2dds the namespace /robot_N, or rename its topics")


def check_bases(facts: Facts) -> Iterator[Finding]:
    """Robots whose base cannot be used as it is, and frames that hang on nothing."""
    yield from filter(None, (_base_problem(facts, robot_id) for robot_id in facts.robots))
    frames = facts.frames or {}
    told = {robot_id for robot_id in facts.robots if _gap(frames, robot_id)}
    # One child of each.
    for parent, child in sorted({parent: child for child, parent in frames.items()}.items()):
        robot_id, local = names.split_robot_key(parent) or (None, parent)
        is_base = local in (names.ODOM, names.BASE_FOOTPRINT) and (robot_id is not None or told)
        is_told = is_base or robot_id in told
        if parent not in {*frames, *names.GLOBAL_FRAMES} and not is_told:
            step = f"publish where {parent} is ([[static_transforms]], or joint_states for a URDF's joint)"
            step = f"{step}, or give {child} another parent{did_you_mean(parent, frames.keys() - {child})}"
            yield problem("transforms", f"{child} hangs on {parent}, which has no parent frame", step)


def _base_problem(facts: Facts, robot_id: int) -> Finding | None:
    """Stamps that are not of now; or, of a robot that stands, the transform that lacks between `map` and its base."""
    robot, status = names.robot_name(robot_id), facts.statuses.get(robot_id)
    for key, seconds in sorted(facts.leads.items()):
        # A robot does not drive by data that is older than LATE.
        if key.startswith(f"{robot}/") and abs(seconds) > LATE + APART:
            text = f"{key} is stamped {abs(seconds):.1f} s {'ahead of' if seconds > 0.0 else 'behind'} this host"
            step = "have the base stamp its data by its machine's clock (not 0, nor since its boot), and NTP set that"
            return problem("stamps", text, step)
    if facts.frames is None or facts.lacks(robot_id) or (status is not None and status.speed):
        return None
    gap = _gap(facts.frames, robot_id)
    return gap and problem("transforms", f"{robot} has no pose in map: no process publishes {gap[0]}", gap[1])


def _gap(frames: Mapping[str, str], robot_id: int) -> tuple[str, str] | None:
    """The transform that lacks between `map` and a robot's base, and what to do; None if they are connected."""
    own, odom, base = (names.robot_frame(robot_id, name) for name in ("", names.ODOM, names.BASE_FOOTPRINT))
    tf, fixed = (names.robot_key(robot_id, topic) for topic in (names.TF, names.TF_STATIC))
    frame = base
    while frame in frames:
        frame = frames[frame]
    if frame != base:
        step = f"it is due on {fixed} or {tf}, or in the team file: see 'zteam topic info {fixed}'"
        return None if frame == names.MAP_FRAME else (f"{names.MAP_FRAME} -> {frame}", step)
    edge, step = f"{odom} -> {base}", f"it is due on {tf}: see 'zteam topic info {tf}'"
    for child, parent in sorted(frames.items()):
        is_base = f"/{parent}".endswith(f"/{names.ODOM}") or f"/{child}".endswith(f"/{names.BASE_LINK}")
        is_global = "/" not in parent
        if is_base and (is_global or parent.startswith(own)) and parent not in {*frames, base} - {odom}:
            static = f"; or [[static_transforms]] of the team file: parent = {child!r}, child = {base!r}"
            step = f"have the base name them odom and base_footprint, with or without {own} in front"
            step += ": a leading slash makes names that are of no robot" * is_global
            return f"{edge}, but there is {parent} -> {child}", step + static * (parent == odom)
    return edge, step


def check_lasers(facts: Facts) -> Iterator[Finding]:
    """Scans that no process can use, because it is not known where their laser is on its robot."""
    for key, wrong in sorted(facts.lasers.items()):
        robot = key.partition("/")[0]
        if facts.frames is None or f"{robot}/{names.BASE_FOOTPRINT}" in facts.frames:
            text = f"the scans of {robot} ({key}) cannot be used: they need {wrong.noun}"
            yield problem("lasers", text, wrong.way_out)


def _has_base(facts: Facts, robot_id: int) -> bool:
    return facts.sim is not None or names.robot_key(robot_id, names.ODOM) in facts.writers


_SOURCE = "start what publishes its data: zteam-sim WORLD, or the driver of a real base"


def _boot_step(facts: Facts, status: RobotStatus) -> str:
    scans = names.scan_key(status.robot_id, 0)
    if scans in facts.writers and names.AGGREGATOR not in facts.alive:
        # What it lacks is a pose.
        return "zteam-tf"
    if scans in facts.writers and (wrong := _base_problem(facts, status.robot_id)):
        return wrong.next_step
    if unplaced := facts.lasers.get(scans):
        return unplaced.way_out
    if unled := [each for each in _follow_problems(facts) if status.robot_id in each.robots]:
        return _follow_step(facts, unled[0])
    if facts.stands_still:
        return "its data comes when the world goes on"
    if not _has_base(facts, status.robot_id):
        return _SOURCE
    return f"'zteam topic info {scans}' names the publishers of its scans"


def check_silence(facts: Facts) -> Iterator[Finding]:
    """Robots whose processes answer, but whose main loops publish nothing."""
    for node in facts.nodes:
        robot_id = names.robot_id_of(node.name)
        if robot_id is None or not node.pid or robot_id in facts.statuses:
            continue
        if facts.publishers and names.robot_key(robot_id, names.STATUS) not in facts.publishers:
            text = f"{node.name} is held by process {node.pid} on {node.host}, which publishes no status"
            yield note("robots", f"{text}: zteam teleop, or a node without a gate, drives its base")
        else:
            text = f"{node.name} is alive but publishes no status: its behaviour hangs"
            yield problem("process", text, f"look at its behaviour, then end process {node.pid} on {node.host}")


_SHOWN = 6
"""Of a list of any length."""


def check_elsewhere(facts: Facts) -> Iterator[Finding]:
    """Whether processes that are missing here run in another namespace, or at another router of this machine."""
    if facts.elsewhere and not facts.nodes:
        places = [f"{_place(name)}: {_listed(sorted(found))}" for name, found in sorted(facts.elsewhere.items())]
        text = f"no process is {_place(facts.namespace)}; there are processes {'; '.join(places)}"
        first = min(facts.elsewhere)
        step = f"--namespace {first}" if first else "--namespace '' (and unset ZTEAM_NAMESPACE)"
        yield problem("namespace", text, step)
    tell = note if facts.nodes or facts.elsewhere else problem
    for endpoint, processes in sorted(facts.routers.items()):
        text = f"another router of this machine, at {endpoint}, has processes: {_listed(sorted(processes))}"
        yield tell("router", text, f"--connect {endpoint} (or export ZTEAM_CONNECT={endpoint})")


def _place(namespace: str) -> str:
    return f"in the namespace {namespace!r}" if namespace else "outside of namespaces"


def _listed(items: Sequence[str], gap: str = ", ") -> str:
    more = f" and {len(items) - _SHOWN} more" if len(items) > _SHOWN else ""
    return gap.join(items[:_SHOWN]) + more


def check_processes(facts: Facts) -> Iterator[Finding]:
    """One finding per kind of process, and one for each of some names whose process does not answer."""
    findings = [_of_kind(kind, facts) for kind in kinds.KINDS if kind.on_bus and not kind.optional]
    yield from (finding for finding in findings if finding.good or finding.next_step)
    silent = sorted({node.name for node in facts.nodes if not node.pid})
    for name in silent[:_SHOWN]:
        text = f"{name} is alive but does not answer: it is stopped (Ctrl+Z, SIGSTOP) or hangs"
        step = "continue it ('fg', 'kill -CONT PID') or end it; its name is free when its lease has run out"
        yield problem("process", text, step)
    if len(silent) > _SHOWN:
        yield problem("process", f"{len(silent) - _SHOWN} further processes do not answer", "see 'zteam node list'")


def _of_kind(kind: kinds.Kind, facts: Facts) -> Finding:
    """Whether processes of a kind are alive; bad without a next step where the team can work without them."""
    per_robot = kind.robot_id_of
    found = sorted(filter(kind.includes, facts.alive), key=per_robot and (lambda name: per_robot(name) or 0))
    if found:
        return ok(kind.title, "alive" if per_robot is None else ", ".join(found))
    text = f"no process {kind.name}" if per_robot is None else "none"
    # A team of fewer robots than the world has would leave some of them without GO.
    in_world = len(facts.sim.robots) if facts.sim else 0
    step = kind.hint.format(robots=max(1, len(facts.robots), in_world))
    works = _works_without(kind, facts)
    return note(kind.title, f"{text}: {works}", step) if works and step else problem(kind.title, text, step)


def _works_without(kind: kinds.Kind, facts: Facts) -> str:
    """Why the team works without a kind of process; empty if it does not."""
    driven = (key for i in facts.robots for key in (names.scan_key(i, 0), names.robot_key(i, names.ODOM)))
    if kind.name == names.SIMULATOR and any(key in facts.writers for key in driven):
        return "the robots get data of other processes"
    if kind.name == names.MONITOR and facts.statuses:
        running = all(status.state == RobotState.RUNNING for status in facts.statuses.values())
        return "all robots run, but their health is not watched" if running else ""
    if kind.name == kinds.ROBOT and facts.sim is not None and facts.sim.robots:
        others = all(names.robot_key(i, names.CMD_VEL) in facts.writers for i in facts.sim.robots)
        return "other programs drive all robots of the world" if others else ""
    return ""


def check_robots_of_world(facts: Facts) -> Iterator[Finding]:
    """Processes of robots that the world lacks, and robots of the world without one."""
    if facts.sim is None:
        return
    there = facts.sim.robots
    known = format_robot_ids(there) or "none"
    for i in filter(facts.lacks, facts.robots):
        text = f"robot_{i} has a process, but the world {facts.sim.world} has no robot {i} (it has {known})"
        step = f"zteam sim spawn --id {i} --pose X Y YAW, or start zteam-robot with an id of the world"
        yield problem("robots", text, step)
    idle = [i for i in there if i not in facts.robots and names.robot_key(i, names.CMD_VEL) not in facts.writers]
    if idle and facts.alive & {names.MONITOR, *map(names.robot_name, there)}:
        text = f"no process drives robot{'s' * (len(idle) > 1)} {format_robot_ids(idle)} of the world"
        yield note("robots", text, f"zteam-robot --id {idle[0]}")


def check_followers(facts: Facts) -> Iterator[Finding]:
    """Robots that follow one without a process, and robots that follow each other in a circle."""
    for wrong in _follow_problems(facts):
        yield problem("robots", wrong.text, _follow_step(facts, wrong))


def _follow_problems(facts: Facts) -> list[FollowProblem]:
    leaders = {i: status.leader for i, status in facts.statuses.items() if status.leader >= 0 and i in facts.robots}
    lost = () if facts.team is None else facts.team.lost.tolist()
    return list(follow_problems(leaders, lambda leader: leader in facts.robots or leader in lost))


def _follow_step(facts: Facts, wrong: FollowProblem) -> str:
    first = names.robot_name(wrong.robots[0])
    if wrong.leader is None:
        return f"let one of them lead: start {first} again without --follow"
    if facts.sim is not None and facts.lacks(wrong.leader):
        known = format_robot_ids(facts.sim.robots) or "none"
        return f"the world has no robot {wrong.leader} (it has {known}): start {first} again with another --follow"
    return f"zteam-robot --id {wrong.leader}, or start {first} again with another --follow"


def check_data(facts: Facts) -> Iterator[Finding]:
    """Whether keys carry data, also those that a user's node subscribes to, and whether robots get scans."""
    if not facts.writers:
        yield problem("data", "no key carries data", "start a simulator or a robot")
        return
    silent = [key for key in facts.publishers if is_sensed(key) and key not in facts.writers]
    text = f"data on {counted(len(facts.writers), 'key')}"
    if silent and not facts.stands_still:
        yield note("data", f"{text}, none on {counted(len(silent), 'key')} of sensors, such as {min(silent)}")
    else:
        yield ok("data", text)
    for robot_id in facts.robots if not facts.stands_still else ():
        robot, scans = names.robot_name(robot_id), names.scan_key(robot_id, 0)
        if scans not in facts.writers and not facts.lacks(robot_id):
            others = [key for key in facts.writers if key.startswith(f"{robot}/") and type_of_key(key) is None]
            meant = did_you_mean(scans, others, form="; {} has data: rename it if that is the laser's topic")
            guess = f"has robot {robot_id} a laser, and on {scans}? see 'zteam topic list'{meant}"
            yield problem("data", f"{robot} gets no scan", guess if _has_base(facts, robot_id) else _SOURCE)
    for key, near in facts.unpublished.items():
        yield note("data", f"a node of your own subscribes to {key}, which nothing publishes{near}", "zteam topic list")


def check_writers(facts: Facts) -> Iterator[Finding]:
    """Keys of a robot on which one process at a time publishes, and more do, or are about to."""
    for key in sorted(filter(has_one_writer, {*facts.writers, *facts.publishers})):
        heard, publishers = facts.writers.get(key, ()), facts.publishers.get(key, ())
        what, sent = ("commands", "commands") if names.CMD_VEL in key else ("sensors", "data")
        if len(heard) > 1:
            text = f"{key} has {len(heard)} writers: {', '.join(heard)}"
            yield problem(what, text, f"end all but one: their {sent} take turns")
        elif len(publishers) > 1 and not key.endswith(f"/{names.CMD_VEL}"):
            # On cmd_vel the simulator publishes what a robot answers in lock-step.
            text = f"{key} has {len(publishers)} publishers: {', '.join(publishers)}"
            yield note(what, f"{text}; one of them sends", "end all but one, if that is not meant")


HISTORY_AFTER = 60.0
"""Host seconds without a further refusal after which its cause counts as mended."""


def is_recent(count: KeyCount) -> bool:
    """Whether messages are refused now."""
    return count.dropped > 0 and (count.last_drop_age or 0.0) < HISTORY_AFTER


def format_refusals(count: KeyCount) -> str:
    """`3 refused, the last one 12 s ago: <reason>`."""
    if not count.dropped:
        return "none refused"
    last, age = "" if count.dropped == 1 else "the last one ", count.last_drop_age or 0.0
    shown = f"{age:.0f} s" if age < 120.0 else f"{age / 60:.0f} min" if age < 7200.0 else f"{age / 3600:.0f} h"
    return f"{count.dropped} refused, {last}{shown} ago: {count.last_drop_reason}"


def check_refusals(facts: Facts) -> Iterator[Finding]:
    """One problem for every key on which messages are refused now, with cause and writer; one note for all history."""
    rows = [
        (key, name, count)
        for name, per_key in sorted(facts.counts.items())
        for key, count in per_key.items()
        if count.dropped
    ]
    for key, writers in sorted(facts.dropped.items()):
        text = f"the router drops {key}, which {', '.join(writers)} publishes: the certificate may not publish it"
        yield problem("refusals", text, "'zteam certs explain NAME' lists what it may (docs/security.md)")
    if not rows and not facts.faults and not facts.dropped:
        yield ok("refusals", "no message was refused")
    # A robot that the world lacks and that has a process is told already, as the cause.
    absent = {names.robot_name(i) for i in facts.robots if facts.lacks(i)}
    recent = [row for row in rows if is_recent(row[2]) and row[0].partition("/")[0] not in absent]
    faults = {fault.key: fault for fault in reversed(facts.faults)}
    for key, fault in sorted(faults.items()):
        receivers = ", ".join(name for refused, name, _ in recent if refused == key)
        text = f"{key}: {fault.writer} sends {fault.reason}{f'; refused by {receivers}' if receivers else ''}"
        yield problem("refusals", text, "end or mend what sends it: 'zteam node list' has the processes")
    unexplained = {row[0]: row for row in reversed(recent) if row[0] not in faults}
    for key, name, count in sorted(unexplained.values(), key=lambda row: row[0]):
        writing = ", ".join(facts.writers.get(key, ()))
        step = f"look at {writing}, which writes {key} now" if writing else f"no process writes {key} now"
        step = f"{step}; {HISTORY_AFTER:g} s after the last refusal this is history"
        yield problem("refusals", f"{key}: {name}: {format_refusals(count)}", step)
    past = [f"{key} by {name} ({format_refusals(count)})" for key, name, count in rows if not is_recent(count)]
    if past:
        yield note("refusals", f"none within {HISTORY_AFTER:g} s; before: {_listed(past, '; ')}")


_MOST_ON_A_KEY = 500.0
"""Messages a host second on one key."""
_PER_TICK = 5.0
"""Messages that a process publishes on one key in a tick, at most: a fast simulator has more ticks in a host second."""
_MOST_IN_ALL = 3000.0
"""Messages a host second on all keys, of a session that is no process of the team."""
_MOST_BYTES = 20e6
"""Bytes a host second of such a session."""


def check_floods(facts: Facts) -> Iterator[Finding]:
    """Sessions that flood the bus. The team bears it, but its messages are delayed."""
    for load in facts.loads:
        key = max(load.rates, key=load.rates.__getitem__)
        total = sum(load.rates.values())
        is_flood = load.rates[key] > max(_MOST_ON_A_KEY, _PER_TICK * facts.tick_rate)
        if is_flood or (not load.known and (total > _MOST_IN_ALL or load.size > _MOST_BYTES)):
            more = f" and {counted(len(load.rates) - 1, 'other key')}" if len(load.rates) > 1 else ""
            text = f"{load.writer} floods {key}{more}: {total:.0f} messages a second, {load.size / 1e6:.1f} MB/s"
            yield problem("load", text, f"end or mend {load.writer}{'' if load.known else ': see the sessions'}")


def check_strangers(facts: Facts) -> Iterator[Finding]:
    """Sessions that are none of zteam's. What the router drops of them, such as large messages, shows nowhere else."""
    if facts.strangers:
        count = counted(len(facts.strangers), "session")
        shown = _listed(facts.strangers, "; ")
        yield note("sessions", f"{count} at the router of programs that are none of zteam's: {shown}")


_HARMLESS = CLOCKS_APART + 0.5 * LATE
"""Seconds between two clocks that do not make a command late."""


def check_clocks(facts: Facts) -> Iterator[Finding]:
    """Hosts whose clock differs; a second does no harm to a team, but lines of its logs do not fit together."""
    for host, clock in sorted(facts.clocks.items()):
        if abs(clock.ahead) - clock.error > APART:
            side = "ahead of" if clock.ahead > 0.0 else "behind"
            bound = f"within {1e3 * clock.error:.1f} ms"
            text = f"the clock of {host} is {abs(clock.ahead):.2f} s {side} this host's ({bound})"
            is_harmless = abs(clock.ahead) <= _HARMLESS
            tell = note if is_harmless else problem
            harm = "only their logs do not fit together" if is_harmless else "commands may count as late"
            yield tell("clocks", f"{text}: {harm}", "let one time server (NTP) set the clocks of both")


_CHECKS = (
    check_processes,
    check_floods,
    check_strangers,
    check_clocks,
    check_world,
    check_robots_of_world,
    check_followers,
    check_strays,
    check_bases,
    check_lasers,
    check_gate,
    check_stops,
    check_readiness,
    check_silence,
    check_data,
    check_writers,
    check_map,
    check_refusals,
)


def check_team(facts: Facts) -> list[Finding]:
    """What is good and what is wrong with the team; only where the processes are if none is here."""
    found = list(check_elsewhere(facts))
    if found and not facts.nodes:
        return found
    return [*found, *(finding for check in _CHECKS for finding in check(facts))]

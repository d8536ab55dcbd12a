"""Whether data flows, and whether each robot is commanded by one process only."""

from zteam import names
from zteam.diagnosis.facts import Facts
from zteam.diagnosis.finding import Finding, ok, problem
from zteam.diagnosis.motion import stands_still
from zteam.numbers import counted


def check_data(facts: Facts) -> list[Finding]:
    """Whether keys carry data, and whether each robot's process gets scans."""
    count = len(facts.writers)
    if not count:
        return [problem("data", "no key carries data", "start a simulator or a robot")]
    found = [ok("data", f"data on {counted(count, 'key')}")]
    if stands_still(facts):
        return found
    for robot_id in facts.robots:
        if facts.sim is not None and robot_id not in facts.sim.robots:
            continue
        if names.scan_key(robot_id, 0) not in facts.writers:
            step = f"has the world a robot {robot_id} with a laser? see 'zteam topic list'"
            found.append(problem("data", f"{names.robot_name(robot_id)} gets no scan", step))
    return found


def check_writers(facts: Facts) -> list[Finding]:
    """Robots that get commands from more than one process."""
    found = []
    for key, writers in sorted(facts.writers.items()):
        target = names.split_robot_key(key)
        if target is not None and target[1] == names.CMD_VEL and len(writers) > 1:
            text = f"{key} has {len(writers)} writers: {', '.join(writers)}"
            found.append(problem("commands", text, "end all but one: their commands take turns"))
    return found

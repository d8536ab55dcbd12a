"""All checks of a team, in the order in which they are told: causes come before what follows from them."""

from zteam.diagnosis.data import check_data, check_writers
from zteam.diagnosis.facts import Facts
from zteam.diagnosis.finding import Finding
from zteam.diagnosis.maps import check_map
from zteam.diagnosis.motion import check_frames, check_gate, check_readiness, check_silence, check_world
from zteam.diagnosis.processes import check_elsewhere, check_processes, check_robots_of_world
from zteam.diagnosis.refusals import check_refusals

_CHECKS = (
    check_processes,
    check_world,
    check_robots_of_world,
    check_gate,
    check_readiness,
    check_frames,
    check_silence,
    check_data,
    check_writers,
    check_map,
    check_refusals,
)


def check_team(facts: Facts) -> list[Finding]:
    """What is good and what is wrong with the team; only where the processes are if none is here."""
    found = check_elsewhere(facts)
    if found and not facts.nodes:
        return found
    return [*found, *(finding for check in _CHECKS for finding in check(facts))]

"""All checks of a team, in the order in which they are told: causes come before what follows from them."""

from zteam.diagnosis.data import check_data, check_writers
from zteam.diagnosis.facts import Facts
from zteam.diagnosis.finding import Finding
from zteam.diagnosis.maps import check_map
from zteam.diagnosis.motion import check_gate, check_readiness, check_silence, check_world
from zteam.diagnosis.processes import check_namespace, check_processes, check_robots_of_world
from zteam.diagnosis.refusals import check_refusals

_CHECKS = (
    check_processes,
    check_world,
    check_robots_of_world,
    check_gate,
    check_readiness,
    check_silence,
    check_data,
    check_writers,
    check_map,
    check_refusals,
)


def check_team(facts: Facts) -> list[Finding]:
    """What is good and what is wrong with the team; only the namespace if the team is in another one."""
    return check_namespace(facts) or [finding for check in _CHECKS for finding in check(facts)]

"""What each certificate of a team may do, and the access control of the router that follows (docs/security.md).

Every certificate may read. What a process writes, answers and changes is in two tables: `_PARTS`, by the kind of
process, and `_GRANTED`, what a team file may add.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import msgspec

from zteam import names
from zteam.messages.topics import SENSORS
from zteam.node import kinds
from zteam.team.file.entries import GRANTS, NO_WORLD, Team, navigation_of

OPERATOR = names.OPERATOR
TITLES = {"publishes": "publishes", "answers": "answers queries", "holds": "holds tokens", "asks": "changes by queries"}
"""The fields of Rights that hold keys, and what a table calls them."""


class Rights(msgspec.Struct, frozen=True, omit_defaults=True):
    """What one certificate may do besides reading. All are key expressions without a namespace."""

    publishes: tuple[str, ...] = ()
    answers: tuple[str, ...] = ()
    """Queries."""
    holds: tuple[str, ...] = ()
    """Presence tokens, and claims on names."""
    asks: tuple[str, ...] = ()
    """Those of CHANGES that it may ask for."""
    links: bool = False
    """Whether it carries the messages of others, as the router of another machine does: it may do everything."""

    def __or__(self, other: "Rights") -> "Rights":
        both = {field: tuple(dict.fromkeys((*getattr(self, field), *getattr(other, field)))) for field in TITLES}
        return Rights(**both, links=self.links or other.links)


def _of_robot(*topics: str) -> tuple[str, ...]:
    return tuple(f"{_ROBOT}/{topic}" for topic in topics)


_NAME, _ROBOT = "{name}", "{robot}"
"""In the tables: the process's name, and `robot_N` of its robot, or of any where it has none."""

_MEASURED = _of_robot(*SENSORS, *map(names.all_numbered, SENSORS), names.TF, names.TF_STATIC, names.BASE_INFO)
"""What a simulator or a base tells of a robot."""
_PLANNED = _of_robot(
    names.CMD_VEL_NAV, names.NAVIGATION_STATUS, names.TF, names.AMCL_POSE, names.PARTICLE_CLOUD,
    names.PUBLISHED_FOOTPRINT, names.PLAN, names.LOCAL_PLAN, names.GLOBAL_COSTMAP, names.LOCAL_COSTMAP,
)  # fmt: skip
_CANCEL, _LOCALIZE = _of_robot(f"{names.NAVIGATION}/cancel", f"{names.NAVIGATION}/global_localization")
_LISTS = _of_robot(names.GOALS, names.PAUSE_GOALS, names.RESUME_GOALS)
_STOPS = _of_robot(names.STOP, names.ENGAGE, names.RELEASE)
"""Answered by what commands a robot, and by the simulator."""
_STOP, _RELEASE = (names.all_robots_key(service) for service in (names.ENGAGE, names.RELEASE))
_DESCRIBE, _SET, _SAFETY = _of_robot("describe_parameters", "set_parameters", "safety")
_SIMULATE = tuple(
    names.service_key(names.SIMULATOR, service)
    for service in ("pause", "resume", "speed", "step", "reset", "spawn", "remove", "move", "repeat", "fault")
)
_REPLAY = tuple(names.service_key(names.REPLAY, each) for each in ("pause", "resume", "seek", "step", "speed"))
_CUT = names.service_key(names.LAUNCHER, names.LINKS)
_SIGNAL = names.service_key(names.LAUNCHER, names.SIGNAL)
_START = names.service_key(names.LAUNCHER, names.START)
_ADD_FRAME = names.service_key(names.AGGREGATOR, "static")

_OWN = Rights(
    publishes=(names.log_key(_NAME), names.done_key(_NAME)),
    answers=tuple(names.service_key(_NAME, each) for each in ("info", "stats", "log", "timing", names.LACKING)),
    holds=(names.tokens_key(_NAME), names.claim_key(_NAME, "*")),
    asks=(_STOP,),
)
"""What every process does under its name; and each may stop all robots."""

_PARTS = {
    kinds.ROUTER: Rights(links=True),
    # In lock-step it passes the robots' commands on.
    names.SIMULATOR: Rights(
        (names.CLOCK, names.MAP, names.TICK, *_MEASURED, *_of_robot(names.CMD_VEL)),
        (f"{names.SIMULATOR}/*", *_STOPS),
        holds=(names.lockstep_key("*"),),
    ),
    names.MAP_SERVER: Rights((names.MAP,)),
    names.AGGREGATOR: Rights((names.TF, names.TF_STATIC), (f"{names.AGGREGATOR}/*",)),
    names.MONITOR: Rights((names.TEAM_STATUS,)),
    names.LAUNCHER: Rights(answers=(f"{names.LAUNCHER}/*",)),
    names.VIEW: Rights(),
    names.RECORDER: Rights(),
    OPERATOR: Rights(asks=(_RELEASE,)),
    kinds.ROBOT: Rights(
        _of_robot(names.CMD_VEL, names.STATUS, names.NAVIGATION_STATUS), (_DESCRIBE, _SET, _CANCEL, _SAFETY, *_STOPS)
    ),
    kinds.NAVIGATION: Rights(_PLANNED, _of_robot(f"{names.NAVIGATION}/*")),
}
"""What a process does beyond that, by its kind."""
_OTHER = Rights((f"{_NAME}/**",), (f"{_NAME}/**",))
"""A process of no kind, such as a user's node."""


def _filled(rights: Rights, name: str = "", robots: Iterable[str] = (names.ALL_ROBOTS,)) -> Rights:
    """The rights of the process `name` of these robots."""
    robots = list(robots)

    def fill(keys: Iterable[str]) -> tuple[str, ...]:
        return tuple(dict.fromkeys(key.format(name=name, robot=robot) for key in keys for robot in robots))

    return msgspec.structs.replace(rights, **{field: fill(getattr(rights, field)) for field in TITLES})


_GRANTED = {
    "teleop": Rights(_of_robot(names.CMD_VEL_TELEOP)),
    # zteam goals is a process of its own.
    "goals": Rights(_of_robot(names.GOAL_POSE, names.INITIAL_POSE), _LISTS, asks=(_CANCEL, _LOCALIZE, *_LISTS[1:]))
    | _filled(_OWN, names.GOALS),
    "simulation": Rights(asks=(*_SIMULATE, *_REPLAY, _CUT, _SIGNAL)),
    "parameters": Rights(asks=(_SET,)),
    "processes": Rights(asks=(_START,)),
    "transforms": Rights(asks=(_ADD_FRAME,), holds=(names.token_key(names.STATIC_CALLER, "*"),)),
    "release": Rights(asks=(_RELEASE,)),
}
"""By the words of GRANTS."""


_BY_COMMAND = {
    "chaos": "simulation",
    "goals": "goals",
    "goto": "goals",
    "param": "parameters",
    "sim": "simulation",
    "stop": "release",
    "teleop": "teleop",
}
"""The words for commands of zteam that are nodes of a team: what they are for, they may do."""


CHANGES = tuple(key for word in GRANTS for key in _filled(_GRANTED[word]).asks if key != _STOP)
"""All queries that change something (docs/keys.md) but the stop: a team file grants them."""


def rights_of(team: Team) -> dict[str, Rights]:
    simulated = team.team.world != NO_WORLD
    processes = [kinds.ROUTER, names.AGGREGATOR, names.MONITOR, names.LAUNCHER, names.VIEW, names.RECORDER, OPERATOR]
    ids = [robot.id for robot in team.robots]
    navigated = [robot.id for robot in team.robots if navigation_of(robot) is not None]
    processes += [names.SIMULATOR] if simulated else [names.MAP_SERVER, *map(names.base_name, ids)]
    processes += [names.MAP_SERVER] if team.team.map is not None else []
    processes += [*map(names.robot_name, ids), *map(names.navigation_name, navigated)]
    processes += [node.name for node in team.nodes]
    granted = team.security.grants
    found = {name: _part_of(name, navigated, simulated) for name in (*processes, *granted)}
    # A node may drive what no process of the team does.
    free = [names.robot_name(robot.id) for robot in team.robots if not robot.has_process]
    for node in team.nodes:
        program, verb = (*node.command, "")[:2]
        found[node.name] |= _filled(Rights(_of_robot(names.CMD_VEL)), node.name, free)
        if program == "zteam" and verb in _BY_COMMAND:
            found[node.name] |= _filled(_GRANTED[_BY_COMMAND[verb]])
    for name, words in granted.items():
        for word in words:
            found[name] |= _filled(_GRANTED[word])
    return found


def _part_of(name: str, navigated: Sequence[int], simulated: bool) -> Rights:
    """What the process `name` does. The first of the navigation's names also stands for one process for all."""
    own = _filled(_OWN, name)
    if name == names.VIEW:
        # Further views have names of their own.
        own |= _filled(_OWN, f"{names.VIEW}_$*")
    if (robot_id := names.robot_id_of(name)) is not None:
        return own | _filled(_PARTS[kinds.ROBOT], name, [names.robot_name(robot_id)])
    if (robot_id := names.navigated_robot_of(name)) is not None:
        ids = navigated if robot_id == min(navigated, default=None) else [robot_id]
        for each in ids:
            own |= _filled(_OWN, names.navigation_name(each))
        return own | _filled(_PARTS[kinds.NAVIGATION], name, map(names.robot_name, ids))
    if not simulated and (robot_id := names.base_robot_of(name)) is not None:
        return own | _filled(Rights(_MEASURED), name, [names.robot_name(robot_id)])
    return own | _filled(_PARTS.get(name, _OTHER), name)


_LATCH = "@adv/pub/**"
"""Below a key: what a latched topic's publisher holds and answers. No wildcard means a part of a key with @."""
_EVERYTHING = ("**", "**/@adv/**")
_SESSIONS = (names.declarations_key("*"), names.session_info_key("*"))
"""What every session answers."""
_CHECKED = names.checked_key("*", "*")
_ROUTER_RECORD = "@/*/router"
_WATCH = ("declare_subscriber", "liveliness_query", "declare_liveliness_subscriber")
_ANSWER = ("declare_queryable", "reply")
_HOLD = ("liveliness_token",)
_ASK = ("query",)
_PUBLISH = ("put", "reply")
"""What a latched topic sends to a late subscriber is a reply."""
_ALL = ("put", "delete", *_WATCH, *_ANSWER, *_HOLD, *_ASK)
"""All kinds of messages that Zenoh's access control tells apart. No certificate may delete: nothing of zteam does."""


def access_control(
    rights: Mapping[str, Rights], common_names: Mapping[str, Sequence[str]], namespace: str = ""
) -> dict[str, Any]:
    """The section `access_control` of the router's configuration: what is not allowed here is dropped. `common_names`
    are those that are valid now, by name; a name without one has no rights. All keys are below `namespace`."""
    rules: list[dict[str, Any]] = []

    def rule(name: str, messages: Iterable[str], keys: Iterable[str], *flows: str, permission: str = "allow") -> None:
        found = {"id": name, "messages": [*messages], "key_exprs": [*keys], "flows": [*flows], "permission": permission}
        rules.append(found)

    def here(keys: Iterable[str]) -> list[str]:
        return [f"{namespace}/{key}" if namespace else key for key in keys]

    # All within the namespace: a wildcard in its place would reach it too, and pass the rules that deny.
    rule("receive", _ALL, [*here((*_EVERYTHING, "@session/**")), "@/**"], "egress")
    rule("watch", _WATCH, here((*_EVERYTHING, _CHECKED)), "ingress")
    rule("ask", _ASK, [*here((*_EVERYTHING, *_SESSIONS)), _ROUTER_RECORD], "ingress")
    rule("tell", _ANSWER, here(_SESSIONS), "ingress")
    rule("check", _HOLD, here([_CHECKED]), "ingress")
    rule("link", _ALL, ["**", "**/@adv/**", "**/@session/**", "@/**"], "ingress", "egress")
    common = [each["id"] for each in rules if each["id"] != "link"]
    policies = []
    subjects = []
    for name, each in rights.items():
        valid = common_names.get(name, ())
        if not valid:
            # A subject without a name would mean every session.
            continue
        subjects.append({"id": name, "cert_common_names": [*valid]})
        if each.links:
            policies.append({"rules": ["link"], "subjects": [name]})
            continue
        own = len(rules)
        latches = [f"{key}/{_LATCH}" for key in each.publishes]
        rule(f"{name} publishes", _PUBLISH, here(each.publishes), "ingress")
        rule(f"{name} keeps", (*_ANSWER, *_HOLD), here(latches), "ingress")
        rule(f"{name} answers", _ANSWER, here(each.answers), "ingress")
        proofs = [names.right_key(key, names.PUBLISHES, "*") for key in each.publishes]
        proofs += [names.right_key(key, names.ANSWERS, "*") for key in each.answers]
        rule(f"{name} holds", _HOLD, here([*each.holds, *proofs]), "ingress")
        denied = [key for key in CHANGES if key not in each.asks]
        if denied:
            rule(f"{name} changes nothing by", _ASK, here(denied), "ingress", permission="deny")
        policies.append({"rules": common + [found["id"] for found in rules[own:]], "subjects": [name]})
    return {
        "enabled": True, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies,
    }  # fmt: skip


def explain(rights: Rights) -> list[tuple[str, str]]:
    """A table: what the certificate may do, and with which keys."""
    if rights.links:
        return [("carries", "the messages of others: it may do everything")]
    return [(title, key) for field, title in TITLES.items() for key in getattr(rights, field)]

"""What the doctor says of a team that has one thing wrong: every line, with what to do about it."""

import math
import re
from typing import Any

import msgspec
import numpy as np
import pytest

from zteam import names
from zteam.bus.presence import ProcessInfo
from zteam.bus.receiving import KeyCount
from zteam.messages import (
    Header,
    MapMetaData,
    OccupancyGrid,
    Point,
    Pose,
    RobotState,
    RobotStatus,
    TeamState,
    TeamStatus,
)
from zteam.monitor.doctor import checks
from zteam.monitor.doctor.checks import check_team
from zteam.monitor.doctor.facts import Facts, Finding, HostClock, Load, UnusableMessages
from zteam.monitor.doctor.maps import check_map_file, compare_with_world
from zteam.node import kinds
from zteam.simulator.client import MapInfo, SimStatus
from zteam.transforms.lasers import LaserProblem

WORLD_MAP = MapInfo(-5.0, -4.0, 0.0, 0.05, 200, 160)


def nodes(*alive: str, silent: tuple[str, ...] = ()) -> list[ProcessInfo]:
    """Processes of these names; those in `silent` do not answer."""
    return [ProcessInfo(name, "host", 0 if name in silent else 1000 + i, 1, name) for i, name in enumerate(alive)]


def sim_status(**changes: Any) -> SimStatus:
    """A world of two robots that runs."""
    status = SimStatus("arena", [0, 1], 100_000_000, 1, 5_000_000_000, 50, 1.0, map=WORLD_MAP)
    return msgspec.structs.replace(status, **changes)


def robot_status(robot_id: int, state: int = RobotState.RUNNING, **fields: Any) -> RobotStatus:
    """What a robot says of itself."""
    return RobotStatus(robot_id=robot_id, state=state, **fields)


def team_status(*, ready: list[int], missing: list[int], lost: list[int] | None = None, size: int = 2) -> TeamStatus:
    """What the monitor says: GO if nothing is missing."""
    state = TeamState.GO if len(ready) >= size else TeamState.WAITING
    ids = (np.array(part, np.int32) for part in (ready, missing, lost or []))
    return TeamStatus(state=state, team_size=size, **dict(zip(("ready", "missing", "lost"), ids, strict=True)))


def grid(x: float, y: float, resolution: float = 0.05, columns: int = 200, rows: int = 160) -> OccupancyGrid:
    """A map without cells."""
    info = MapMetaData(resolution=resolution, width=columns, height=rows, origin=Pose(Point(x, y, 0.0)))
    return OccupancyGrid(Header(frame_id=names.MAP_FRAME), info)


def team_facts(**changes: Any) -> Facts:
    """Two robots that drive in a world of two, with every process there."""
    keys = ["base_scan", "cmd_vel", "status"]
    writers = {f"robot_{i}/{key}": ["sim" if key == "base_scan" else f"robot_{i}"] for i in (0, 1) for key in keys}
    facts = Facts(
        nodes=nodes("monitor", "robot_0", "robot_1", "sim", "tf"),
        writers={**writers, "map": ["sim"]},
        statuses={0: robot_status(0), 1: robot_status(1)},
        team=team_status(ready=[0, 1], missing=[]),
        sim=sim_status(),
        map=grid(-5.0, -4.0),
        map_writer="sim",
    )
    return msgspec.structs.replace(facts, **changes)


ALL = ("monitor", "robot_0", "robot_1", "sim", "tf")
REST = nodes("monitor", "robot_0", "sim", "tf")
"""Without robot 1."""
ALONE = {0: robot_status(0)}
BOTH = ["robot_0", "session 1f"]
WRITERS = team_facts().writers


def line_of(finding: Finding) -> str:
    """A finding as one line."""
    step = f" -> {finding.next_step}" if finding.next_step else ""
    return f"{finding.level} {finding.what}: {finding.text}{step}"


def lines_of(facts: Facts) -> list[str]:
    """All that is found, but for what is as it should be."""
    return [line_of(finding) for finding in check_team(facts) if finding.level != "ok"]


def held(*silent: str) -> Facts:
    """Lock-step waits in the same tick."""
    return team_facts(sim=sim_status(lockstep=True, waiting_for="x", silent=[*silent]), holds=True)


def with_second(status: RobotStatus, **changes: object) -> Facts:
    """A team whose robot 1 says this."""
    return team_facts(statuses={**ALONE, 1: status}, **changes)


REAL: dict[str, object] = {"nodes": nodes("monitor", "robot_0", "robot_1", "tf"), "sim": None, "map": None}
"""Of a team without a simulator."""


def boots(robot_id: int, text: str, leader: int = -1) -> RobotStatus:
    """A robot that waits."""
    return robot_status(robot_id, RobotState.BOOT, text=text, leader=leader)


def of_robot(robot_id: int, parents: dict[str, str]) -> dict[str, str]:
    """The parents of its frames, `map` apart with their full names."""
    return {
        f"robot_{robot_id}/{child}": parent if parent == "map" else f"robot_{robot_id}/{parent}"
        for child, parent in parents.items()
    }


IN_MAP = of_robot(0, {"odom": "map", "base_footprint": "odom"})

FINDINGS: dict[str, tuple[Facts | str, ...]] = {
    "a team that works": (team_facts(),),
    "no process": (
        Facts(writers={"clock": ["sim"]}, unpublished={"robot_0/scan": ": did you mean robot_0/base_scan?"}),
        "problem simulator: no process sim -> zteam-sim WORLD (or real robots that publish the same keys)",
        "problem transforms: no process tf -> zteam-tf",
        "problem monitor: no process monitor -> zteam-monitor --team-size 1",
        "problem robots: none -> zteam-robot --id 0",
        "note data: a node of your own subscribes to robot_0/scan, which … did you mean robot_0/base_scan? -> …",
    ),
    "robots that one program drives": (
        team_facts(nodes=nodes("monitor", "sim", "swarm", "tf"), statuses={}),
        "note robots: none: other programs drive all robots of the world -> zteam-robot --id 0",
    ),
    "robots by number, and a team of their size": (
        Facts(nodes=nodes("robot_10", "robot_2"), writers={"robot_2/base_scan": ["x"], "robot_10/base_scan": ["x"]}),
        "note simulator: no process sim: the robots … -> zteam-sim WORLD (or real robots that publish the same …",
        "problem transforms: no process tf -> zteam-tf",
        "problem monitor: no process monitor -> zteam-monitor --team-size 2",
        "problem process: robot_10 is alive but … -> look at its behaviour, then end process 1000 on host",
        "problem process: robot_2 is alive but publishes … -> look at its behaviour, then end process 1001 on …",
    ),
    "a team size of the world": (
        Facts(
            nodes=nodes("robot_0", "sim", "tf"), sim=sim_status(robots=[0, 1, 2, 3], map=None),
            writers={"robot_0/base_scan":["sim"]},
        ),
        "problem monitor: no process monitor -> zteam-monitor --team-size 4",
        "note robots: no process drives robots 1-3 of the world -> zteam-robot --id 1",
        "problem process: robot_0 is alive but publishes … -> look at its behaviour, then end process 1000 on …",
    ),
    "followers without transforms": (
        with_second(robot_status(1, leader=0), nodes=nodes("monitor", "robot_0", "robot_1", "sim")),
        "problem transforms: no process tf -> zteam-tf",
    ),
    "a frozen process": (
        team_facts(nodes=nodes(*ALL, silent=("robot_1",))),
        "problem process: robot_1 is alive but does … -> continue it ('fg', 'kill -CONT PID') or end it; its …",
    ),
    "a simulator that hangs": (
        team_facts(nodes=nodes(*ALL, silent=("sim",)), sim=None, writers={"map": ["sim"]}),
        "problem process: sim is alive but does not … -> continue it ('fg', 'kill -CONT PID') or end it; its …",
    ),
    "real robots": (
        team_facts(**REAL),
        "note simulator: no process sim: the robots … -> zteam-sim WORLD (or real robots that publish the same …",
    ),
    "a base whose scans have another topic": (
        with_second(
            boots(1, "waiting"),
            writers={key: ["x"] for key in ("robot_0/base_scan", "robot_1/base_info", "robot_1/odom", "robot_1/scan")},
            **REAL,
        ),
        "note simulator: no process sim: the robots get data …",
        "problem robots: robot_1 is not ready (boot): waiting -> 'zteam topic info robot_1/base_scan' names …",
        "problem data: robot_1 gets no scan -> has robot 1 … list'; robot_1/scan has data: rename it if that is the …",
    ),
    "a base without scans": (
        with_second(
            boots(1, "waiting"),
            writers={key: ["x"] for key in ("robot_0/base_scan", "robot_1/base_info", "robot_1/odom")},
            **REAL,
        ),
        "note simulator: no process sim: the robots get data …",
        "problem robots: robot_1 is not ready (boot): waiting -> 'zteam topic info robot_1/base_scan' names …",
        "problem data: robot_1 gets no scan -> has robot 1 a laser, and on robot_1/base_scan? see 'zteam topic list'",
    ),
    "no simulator": (
        team_facts(
            nodes=nodes("monitor", "robot_0", "tf"), sim=None, writers={"robot_0/status": ["robot_0"]}, statuses=ALONE,
        ),
        "problem simulator: no process sim -> zteam-sim WORLD (or real robots that publish the same keys)",
        "problem data: robot_0 gets no scan -> start what publishes its data: zteam-sim WORLD, or the driver of …",
    ),
    "no monitor": (
        team_facts(nodes=nodes("robot_0", "robot_1", "sim", "tf"), team=team_status(ready=[0], missing=[1])),
        "note monitor: no process monitor: all robots run, but their health is … -> zteam-monitor --team-size 2",
    ),
    "no monitor before GO": (
        with_second(robot_status(1, RobotState.READY), nodes=nodes("robot_0", "robot_1", "sim", "tf")),
        "problem monitor: no process monitor -> zteam-monitor --team-size 2",
    ),
    "strangers": (
        team_facts(strangers=["session abc, tcp/10.0.0.7:40000"]),
        "note sessions: 1 session at the router of programs that are none of zteam's: session abc, tcp/10.0.0.7:40000",
    ),
    "clock ahead": (
        team_facts(clocks={"lab": HostClock(1.0, 0.002)}),
        "note clocks: the clock of lab is 1.00 s ahead of this host's (within 2.0 ms): only their logs … -> let one …",
    ),
    "clock behind": (
        team_facts(clocks={"lab": HostClock(-3.0, 0.002)}),
        "problem clocks: the clock of lab is 3.00 s behind … -> let one time server (NTP) set the clocks of both",
    ),
    "clocks that may agree": (
        team_facts(clocks={"a": HostClock(0.2, 0.0), "b": HostClock(-0.2, 0.0), "c": HostClock(1.0, 0.9)}),
    ),
    "another namespace": (
        Facts(namespace="mine", elsewhere={"lab": ["sim", "robot_1"], "": ["tf"]}),
        (
            "problem namespace: no process is in the namespace 'mine'; there are processes outside of namespaces: tf; "
            "in the namespace 'lab': robot_1, sim -> --namespace '' (and unset ZTEAM_NAMESPACE)"
        ),
    ),
    "a namespace of many": (
        Facts(elsewhere={"lab": [f"robot_{i}" for i in range(10)]}),
        "problem namespace: no process is outside of namespaces; … robot_4, robot_5 and 4 more -> --namespace lab",
    ),
    "another namespace beside this team": (team_facts(elsewhere={"lab": ["sim"]}),),
    "another router": (
        Facts(routers={"tcp/127.0.0.1:7448": ["lab/tf", "sim"]}),
        "problem router: another router … at tcp/127.0.0.1:7448, has processes: lab/tf, sim -> --connect tcp/127.0…",
    ),
    "another router and namespace": (
        Facts(routers={"tcp/127.0.0.1:7448": ["sim"]}, elsewhere={"lab": ["sim"]}),
        "problem namespace: no process is outside of namespaces; there are processes in the … -> --namespace lab",
        "note router: another router of this machine, … -> --connect tcp/127.0.0.1:7448 (or export …",
    ),
    "another router beside this team": (
        team_facts(routers={"tcp/127.0.0.1:7448": ["sim"]}),
        "note router: another router of this machine, … -> --connect tcp/127.0.0.1:7448 (or export …",
    ),
    "paused": (
        team_facts(sim=sim_status(paused=True), writers={"robot_0/status": ["robot_0"]}),
        "problem world: the simulator is paused at 5.000 s (tick 50) -> zteam sim resume",
    ),
    "over": (
        team_facts(sim=sim_status(finished=True, paused=True)),
        "note world: the run is over at 5.000 s (tick 50): the world stands still -> zteam sim reset",
    ),
    "held by a robot that lives": (
        held("robot_1"),
        "problem world: lock-step is held at 5.000 s … -> look at the log of robot_1; it is left behind after …",
    ),
    "held by a robot without a process": (
        held("robot_4"),
        "problem world: lock-step is held at 5.000 s (tick 50): it waits for x -> zteam-robot --id 4",
    ),
    "held by a node without a process": (
        held("planner", "robot_1"),
        "problem world: lock-step is held at 5.000 s (tick 50): it waits for x -> start planner",
    ),
    "held before GO": (
        held(),
        "problem world: lock-step is held at 5.000 s … -> start the monitor, and the robots that it waits for",
    ),
    "lock-step that goes on": (team_facts(sim=sim_status(lockstep=True, waiting_for="robot_1")),),
    "a robot that the world lacks": (
        team_facts(
            nodes=nodes("monitor", "robot_0", "robot_1", "robot_7", "sim", "tf"),
            statuses={0: robot_status(0), 1: robot_status(1), 7: boots(7, "waiting for a first scan")},
            counts={"sim": {"robot_7/cmd_vel": KeyCount(0, 7, 2.0, "the world has no such robot")}},
        ),
        "problem robots: robot_7 has a process, but … no robot 7 (it has 0, 1) -> zteam sim spawn --id 7 --pose …",
    ),
    "a robot of the world that nothing drives": (
        team_facts(nodes=REST, statuses=ALONE, writers={"robot_0/base_scan": ["sim"]}),
        "note robots: no process drives robot 1 of the world -> zteam-robot --id 1",
    ),
    "one that a script drives": (team_facts(nodes=REST, statuses=ALONE),),
    "a circle": (
        team_facts(statuses={0: robot_status(0, leader=1), 1: robot_status(1, leader=0)}),
        "problem robots: robots follow … robot_0 -> robot_1 -> robot_0 -> let one of them lead: start robot_0 again …",
    ),
    "a leader that the world lacks": (
        with_second(boots(1, "waiting for its leader", leader=9)),
        "problem robots: robot_1 follows robot_9, … -> the world has no robot 9 (it has 0, 1): start robot_1 …",
        "problem robots: robot_1 is not ready (boot): … -> the world has no robot 9 (it has 0, 1): start robot_1 …",
    ),
    "a leader without a process": (
        with_second(robot_status(1, leader=9), sim=sim_status(robots=[0, 1, 9])),
        "note robots: no process drives robot 9 of the world -> zteam-robot --id 9",
        "problem robots: robot_1 follows robot_9, … -> zteam-robot --id 9, or start robot_1 again with another …",
    ),
    "a leader that was lost": (
        with_second(
            robot_status(1, leader=9), team=team_status(ready=[0, 1], missing=[], lost=[9]),
            sim=sim_status(robots=[0, 1, 9]),
        ),
        "note robots: no process drives robot 9 of the world -> zteam-robot --id 9",
        "problem gate: the process of robot_9 was … -> start it again: zteam-robot --id 9, with its behaviour",
    ),
    "the gate waits for a process": (
        team_facts(nodes=REST, team=team_status(ready=[0], missing=[1])),
        "problem gate: the start gate waits for robot_1 (1 of 2 ready) -> zteam-robot --id 1",
    ),
    "for a robot that the world lacks": (
        team_facts(team=team_status(ready=[0, 1], missing=[7], size=3)),
        "problem gate: the start gate waits for robot_7 (2 … -> the world has no robot 7: zteam-monitor --ids 0,1",
    ),
    "for more than the world has": (
        team_facts(team=team_status(ready=[0], missing=[], size=4), nodes=REST),
        "problem gate: the start gate waits for 3 … -> the world has 2 robots: zteam-monitor --team-size 2, or …",
    ),
    "for more of any": (
        team_facts(team=team_status(ready=[0, 1], missing=[], size=3), sim=None),
        "problem gate: the start gate waits for 1 more of any id (2 … -> start further robots: zteam-robot --id N",
    ),
    "for a robot that boots": (
        with_second(
            boots(1, "no scan"),
            team=msgspec.structs.replace(team_status(ready=[0], missing=[1]), waiting_for="robot_1: no scan"),
        ),
        "problem gate: the start gate waits for robot_1 (1 of 2 ready) -> see what these robots wait for",
        "problem robots: robot_1 is not ready (boot): … -> 'zteam topic info robot_1/base_scan' names the …",
    ),
    "a lost robot": (
        team_facts(nodes=REST, team=team_status(ready=[0, 1], missing=[], lost=[1])),
        "problem gate: the process of robot_1 was … -> start it again: zteam-robot --id 1, with its behaviour",
    ),
    "a lost robot that left the world": (
        team_facts(nodes=REST, team=team_status(ready=[0, 1], missing=[], lost=[1]), sim=sim_status(robots=[0])),
    ),
    "stopped": (
        team_facts(
            sim=sim_status(stopped=[1]),
            statuses={0: robot_status(0, is_stopped=True, reason="stopped"), 1: robot_status(1)},
        ),
        "problem stop: 'zteam stop' holds robots 0, 1 -> zteam stop --release",
    ),
    "one stopped": (
        team_facts(sim=sim_status(stopped=[1])),
        "problem stop: 'zteam stop' holds robot 1 -> zteam stop --release",
    ),
    "boot without an aggregator": (
        team_facts(
            nodes=nodes("monitor", "robot_0", "robot_1", "sim"),
            statuses={0: boots(0, "waiting for its own pose in map"), 1: robot_status(1)},
        ),
        "problem transforms: no process tf -> zteam-tf",
        "problem robots: robot_0 is not ready (boot): waiting for its own pose in map -> zteam-tf",
    ),
    "boot with one": (
        team_facts(statuses={0: boots(0, ""), 1: robot_status(1)}),
        "problem robots: robot_0 is not ready (boot): … -> 'zteam topic info robot_0/base_scan' names the …",
    ),
    "boot in a world that stands": (
        team_facts(statuses={0: boots(0, "waiting"), 1: robot_status(1)}, sim=sim_status(paused=True)),
        "problem world: the simulator is paused at 5.000 s (tick 50) -> zteam sim resume",
        "problem robots: robot_0 is not ready (boot): waiting -> its data comes when the world goes on",
    ),
    "boot without a simulator": (
        team_facts(
            nodes=nodes("monitor", "robot_0", "tf"), sim=None, statuses={0: boots(0, "waiting")}, writers={"x": ["y"]},
        ),
        "problem simulator: no process sim -> zteam-sim WORLD (or real robots that publish the same keys)",
        "problem robots: robot_0 is not ready (boot): … -> start what publishes its data: zteam-sim WORLD, or …",
        "problem data: robot_0 gets no scan -> start what publishes its data: zteam-sim WORLD, or the driver of …",
    ),
    "a fault": (
        with_second(robot_status(1, RobotState.FAULT, text="no laser")),
        "problem robots: robot_1 has failed: no laser -> see its log, then start robot_1 again",
    ),
    "a robot that stands": (
        with_second(robot_status(1, text="leader robot_0 not seen")),
        "note robots: robot_1 stands: leader robot_0 not seen",
    ),
    "the status of a process that is gone": (with_second(boots(1, "waiting"), nodes=REST),),
    "a robot without a status": (
        team_facts(statuses=ALONE, publishers={"robot_1/status": ["robot_1"]}),
        "problem process: robot_1 is alive but publishes … -> look at its behaviour, then end process 1002 on …",
    ),
    "a teleop that drives a base": (
        team_facts(statuses=ALONE, publishers={"robot_1/cmd_vel": ["robot_1"]}),
        "note robots: robot_1 is held by process 1002 on host, which publishes no status: zteam teleop, or a node …",
    ),
    "no odom in map": (
        with_second(robot_status(1, speed=0.3), frames={"robot_0/base_footprint": "robot_0/odom"}),
        "problem transforms: robot_0 … map -> robot_0/odom -> it … robot_0/tf_static or robot_0/tf, or … …_static'",
    ),
    "no base in odom": (
        with_second(robot_status(1, speed=0.3), frames={"robot_0/odom": "map"}),
        "problem transforms: robot_0 … robot_0/odom -> robot_0/base_footprint -> it is due on robot_0/tf: …/tf'",
    ),
    "a base whose frames have another prefix": (
        with_second(boots(1, "waiting"), frames={**IN_MAP, **of_robot(1, {"odom": "map", "t/base_link": "t/odom"})}),
        "problem transforms: robot_1 … but there is robot_1/t/odom -> robot_1/t/base_link -> have the base name them …",
        "problem robots: robot_1 is not ready (boot): waiting -> have the base name them odom and …",
    ),
    "a base whose frames are of no robot": (
        with_second(boots(1, "waiting"), frames={**IN_MAP, "base_link": "odom"}),
        "problem transforms: robot_1 … but there is odom -> base_link -> … a leading slash makes names that are …",
        "problem robots: robot_1 is not ready (boot): waiting -> have the base name them odom and …",
    ),
    "a base without a base_footprint": (
        with_second(
            robot_status(1), frames={**IN_MAP, **of_robot(1, {"odom": "map", "base_link": "odom", "x": "base_link"})},
            lasers={"robot_1/base_scan": LaserProblem("its laser's frame", "publish it")},
        ),
        "problem transforms: … robot_1/odom -> robot_1/base_link -> … 'robot_1/base_link', child = 'robot_1/base_foot…",
    ),
    "frames that hang on nothing": (
        team_facts(
            frames={
                **IN_MAP, **of_robot(1, {"odom": "map", "base_footprint": "odom"}),
                "window": "hall", "door": "hall", "robot_1/camera": "robot_1/base_footprnt", "lidar": "base_footprint",
                "robot_2/base_link": "robot_2/base_footprint",
            },
        ),
        "problem transforms: lidar hangs on base_footprint, which … (did you mean robot_…/base_footprint?)",
        "problem transforms: door hangs on hall, which … -> publish … (… joint), or give door another parent",
        "problem transforms: robot_1/camera hangs on … another parent (did you mean robot_1/base_footprint?)",
    ),
    "transforms that go past the aggregator": (
        team_facts(writers={**WRITERS, "tf": ["tf", "a client"], "tf_static": ["tf"], "robot_0/tf": ["base_0"]}),
        "problem transforms: a client publishes on tf or tf_static: … -> … the namespace /robot_N, or rename its …",
    ),
    "transforms of two programs": (
        team_facts(writers={**WRITERS, "tf": ["session b", "session a"]}),
        "problem transforms: session a, session b publish on tf or tf_static: … -> …",
    ),
    "a frame of no robot": (
        team_facts(
            nodes=nodes("bird", "monitor", "robot_0", "robot_1", "sim", "tf"), writers={**WRITERS, "tf": ["tf", "bird"]}
        ),
    ),
    "an aggregator with several names": (
        team_facts(
            nodes=[*nodes("monitor", "robot_0", "robot_1", "sim"), ProcessInfo("sim", "h", 1, 1, "one"),
                   ProcessInfo("tf", "h", 1, 1, "one")],
            writers={**WRITERS, "tf": ["sim"]},
        ),
    ),
    "stamps that are not of now": (
        with_second(
            boots(1, "waiting"), sim=None, nodes=nodes("monitor", "robot_0", "robot_1", "tf"), map=None,
            frames=IN_MAP, leads={"robot_0/odom": 0.7, "robot_1/odom": 3600.2, "robot_1/base_scan": -1.79e9},
        ),
        "note simulator: no process sim: …",
        "problem stamps: robot_1/base_scan is stamped 1790000000.0 s behind this host -> have the base stamp …",
        "problem robots: robot_1 is not ready (boot): waiting -> have the base stamp …",
    ),
    "a base that has no scans": (
        with_second(
            boots(1, "waiting"), sim=None, nodes=nodes("monitor", "robot_0", "robot_1", "tf"), map=None,
            writers={"robot_0/base_scan": ["x"], "robot_1/odom": ["y"]},
        ),
        "note simulator: no process sim: …",
        "problem robots: robot_1 is not ready (boot): … -> 'zteam topic info robot_1/base_scan' names …",
        "problem data: robot_1 gets no scan -> has robot 1 a laser, and on robot_1/base_scan? see 'zteam topic list'",
    ),
    "all in map": (
        team_facts(
            frames={"robot_0/odom": "map", "robot_0/base_footprint": "robot_0/odom"},
            nodes=REST, statuses=ALONE,
        ),
    ),
    "a laser without a place": (
        with_second(boots(1, "waiting"), lasers={"robot_1/base_scan": LaserProblem("its laser's frame", "publish it")}),
        "problem lasers: the scans of robot_1 (robot_1/base_scan) cannot be used: they need its … -> publish it",
        "problem robots: robot_1 is not ready (boot): waiting -> publish it",
    ),
    "no data": (team_facts(writers={}), "problem data: no key carries data -> start a simulator or a robot"),
    "sensors without data": (
        team_facts(
            publishers={f"robot_0/{key}": ["sim"] for key in ("base_scan", "sonar_1", "odom", "tf_static", "status")},
        ),
        "note data: data on 7 keys, none on 2 keys of sensors, such as robot_0/odom",
    ),
    "sensors without data in a world that stands": (
        team_facts(publishers={"robot_0/odom": ["sim"], "robot_0/status": ["robot_0"]}, sim=sim_status(paused=True)),
        "problem world: the simulator is paused at 5.000 s (tick 50) -> zteam sim resume",
    ),
    "a robot without scans": (
        team_facts(writers={"robot_0/base_scan": ["sim"], "robot_1/cmd_vel": ["robot_1"]}),
        "problem data: robot_1 gets no scan -> has robot 1 a laser, and on robot_1/base_scan? see 'zteam topic list'",
    ),
    "two writers": (
        team_facts(
            writers={
                **WRITERS, "map": BOTH,
                **{f"robot_0/{key}": BOTH for key in ("base_info", "cmd_vel_teleop", "odom", "goal_pose", "tf")},
            },
        ),
        "problem sensors: robot_0/base_info has 2 writers: … -> end all but one: their data take turns",
        "problem commands: robot_0/cmd_vel_teleop has 2 writers: … -> end all but one: their commands take turns",
        "problem sensors: robot_0/odom has 2 writers: robot_0, session 1f -> end all but one: their data take turns",
    ),
    "two publishers": (
        team_facts(
            publishers={"robot_0/cmd_vel_teleop": ["zteam teleop", "view"], "robot_0/cmd_vel": ["robot_0", "sim"]},
        ),
        "note commands: robot_0/cmd_vel_teleop has 2 publishers: zteam … -> end all but one, if that is not meant",
    ),
    "what the router drops": (
        team_facts(dropped={"robot_0/near": ["far", "near"]}),
        "problem refusals: the router drops … -> 'zteam certs explain NAME' lists what it may (docs/security.md)",
    ),
    "a fault with its writer": (
        team_facts(
            counts={"robot_0": {"robot_0/odom": KeyCount(9, 3, 0.1, "wrong type")}},
            faults=[
                UnusableMessages("robot_0/odom", "session 1f", "Range"),
                UnusableMessages("map", "mapper", "bytes that are no map"),
            ],
        ),
        "problem refusals: map: mapper sends bytes that are no map -> end or mend what sends it: 'zteam node list' …",
        "problem refusals: robot_0/odom: session 1f sends Range; refused by robot_0 -> end or mend …",
    ),
    "a refusal": (
        team_facts(
            counts={
                "sim": {"robot_1/cmd_vel": KeyCount(0, 7, 2.0, "broken")}, "tf": {"old": KeyCount(5, 2, 9.0, "x")},
            },
        ),
        "problem refusals: old: tf: 2 refused, the last one 9 s ago: x -> no process writes old now; 60 s after …",
        "problem refusals: robot_1/cmd_vel: sim: 7 refused, the last one 2 s ago: broken -> look at robot_1, which …",
    ),
    "history": (
        team_facts(
            counts={
                "sim": {f"robot_{i}/cmd_vel": KeyCount(0, i + 1, 60.0 * 30.0 ** (i % 3), "broken") for i in range(8)}
            },
        ),
        (
            "note refusals: none within 60 s; before: robot_0/cmd_vel by sim (1 refused, 60 s ago: broken); robot_1/… "
            "30 min ago: broken); robot_2/… 15 h ago: broken); robot_3/…; robot_4/…; robot_5/… and 2 more"
        ),
    ),
    "navigation without a map": (
        team_facts(nodes=nodes(*ALL, "nav_1", "nav_0"), map=None),
        "problem map: nothing publishes 'map', without which nav_0, nav_1 cannot work -> zteam-map MAP.yaml",
    ),
    "a map that is shifted": (
        team_facts(map=grid(-2.0, -4.0), map_writer="map_server", writers={**WRITERS, "map": ["map_server", "sim"]}),
        (
            "problem map: 'map' of map_server (newer than that of sim) differs from the world arena: origin (-2, -4) … "
            "shifted by +3.00 m in x and +0.00 m in y -> the world's grid has origin [-5, -4, 0], resolution 0.05, …"
        ),
    ),
    "a map in another frame": (
        team_facts(map=msgspec.structs.replace(grid(-5.0, -4.0), header=Header(frame_id="odom"))),
        "problem map: 'map' of sim is in the frame 'odom', not in 'map' -> let sim publish it in the frame 'map'",
    ),
    "no grid of the world": (team_facts(sim=sim_status(map=None)),),
}  # fmt: skip
"""By what is wrong: the lines, in which `…` stands for any text."""


@pytest.mark.parametrize("case", FINDINGS)
def test_what_is_found(case: str) -> None:
    """Each cause once, before what follows from it, and nothing that follows from it alone."""
    facts, *lines = FINDINGS[case]
    assert isinstance(facts, Facts)
    found = lines_of(facts)
    assert len(found) == len(lines), found
    for line, told in zip(found, lines, strict=True):
        assert re.fullmatch(re.escape(str(told)).replace("…", ".*"), line), line


def test_a_good_team_is_told_what_is_good() -> None:
    """Every kind of process that is alive, how many keys carry data, and that nothing was refused."""
    assert [line_of(finding) for finding in check_team(team_facts())] == [
        "ok simulator: alive",
        "ok transforms: alive",
        "ok monitor: alive",
        "ok robots: robot_0, robot_1",
        "ok data: data on 7 keys",
        "ok map: 'map' of sim lies as the world arena does (200 x 160 cells of 0.05 m)",
        "ok refusals: no message was refused",
    ]


def test_many_tokens_make_a_few_lines() -> None:
    """Any program may hold tokens: a thousand of one name are one line, and of a thousand names a few are named."""
    tokens = ["robot_1"] * 1000 + [f"z{number:03}" for number in range(1000)]
    told = lines_of(team_facts(nodes=nodes("monitor", "robot_0", "sim", "tf", *tokens, silent=tuple(tokens))))
    assert told[0].startswith("problem process: robot_1 is alive but does not answer: ")
    assert told[-1] == "problem process: 995 further processes do not answer -> see 'zteam node list'"
    assert len(told) == 7


@pytest.mark.parametrize("hint", ["start the planner of {robots} robots", ""])
def test_a_further_kind_of_process(monkeypatch: pytest.MonkeyPatch, hint: str) -> None:
    """A new row of the table is found by its name, and missed with its hint; without a hint a team works without it."""
    planner = kinds.Kind("planner", "planner", "zteam-planner", 0, hint)
    monkeypatch.setattr(kinds, "KINDS", (*kinds.KINDS, planner))
    missed = ["problem planner: no process planner -> start the planner of 2 robots"]
    assert lines_of(team_facts()) == (missed if hint else [])
    alive = [line_of(each) for each in check_team(team_facts(nodes=[*team_facts().nodes, *nodes("planner")]))]
    assert "ok planner: alive" in alive


def changed(**changes: float) -> MapInfo:
    """The grid of the world with a change."""
    return msgspec.structs.replace(WORLD_MAP, **changes)


@pytest.mark.parametrize(
    ("found", "level", "text"),
    [
        (WORLD_MAP, "ok", ""),
        (changed(resolution=0.05000000074505806), "ok", ""),
        (changed(x=-4.99), "ok", ""),
        (changed(resolution=0.1, columns=100, rows=80), "ok", ""),
        (changed(resolution=0.1, columns=101, rows=80), "ok", ""),
        (changed(yaw=6.283), "ok", ""),
        (changed(y=-3.95, resolution=0.1, columns=100, rows=80), "ok", ""),
        (changed(resolution=0.1), "problem", "resolution 0.1 instead of 0.05 m; size 20 x 16 instead of 10 x 8 m"),
        (changed(yaw=1.57), "problem", "turned by +1.570 rad"),
        (changed(y=-3.0, resolution=0.1, columns=100, rows=80), "problem", "+1.00 m in y"),
        (changed(x=-4.0, columns=100), "note", "size 5 x 8 instead of 10 x 8 m: it may show another part"),
        (changed(x=math.nan), "problem", "origin (nan, -4)"),
        (changed(yaw=math.nan), "problem", "turned by +nan rad"),
        (changed(resolution=math.nan), "problem", "resolution nan instead of 0.05 m"),
    ],
)
def test_a_map_lies_as_the_world_does(found: MapInfo, level: str, text: str) -> None:
    """One with the world's cells or size must, finer or coarser; another part of it may differ. Rounding does not
    count."""
    finding = compare_with_world("'map'", found, WORLD_MAP, "arena")
    assert finding.level == level
    assert text in finding.text


def test_a_map_file_is_compared_with_the_world() -> None:
    """The finding names the file; without a simulator it says to start one."""
    good = check_map_file("lab.yaml", WORLD_MAP, sim_status())
    assert (good.what, good.level) == ("map file", "ok")
    assert check_map_file("lab.yaml", changed(x=0.0), sim_status()).text.startswith("lab.yaml differs from the world")
    lonely = check_map_file("lab.yaml", WORLD_MAP, None)
    assert (lonely.good, lonely.next_step) == (False, "zteam-sim WORLD")


@pytest.mark.parametrize(
    ("count", "text"),
    [
        (KeyCount(5, 0), "none refused"),
        (KeyCount(5, 1, 3.2, "broken"), "1 refused, 3 s ago: broken"),
        (KeyCount(5, 2, 119.4, "broken"), "2 refused, the last one 119 s ago: broken"),
    ],
)
def test_refusals_in_words(count: KeyCount, text: str) -> None:
    """As `zteam topic info` has them."""
    assert checks.format_refusals(count) == text


@pytest.mark.parametrize(
    ("rates", "size", "known", "tick_rate", "text"),
    [
        ({"junk": 400.0}, 100.0, False, 10.0, None),
        ({"tf": 1.0, "junk": 5000.0}, 1e5, False, 10.0, "it floods junk and 1 other key: 5001 messages a second, 0.1"),
        ({f"k{number}": 1.0 for number in range(5000)}, 100.0, False, 10.0, "it floods k0 and 4999 other keys: 5000"),
        ({"junk": 10.0}, 50e6, False, 10.0, "it floods junk: 10 messages a second, 50.0 MB/s"),
        ({f"robot_{number}/tf": 1000.0 for number in range(20)}, 25e6, True, 1000.0, None),
        ({"junk": 1000.0}, 100.0, True, 10.0, "it floods junk: 1000 messages a second"),
    ],
)
def test_a_flood_is_named(
    rates: dict[str, float], size: float, known: bool, tick_rate: float, text: str | None
) -> None:
    """Many messages on one key or on many, or many bytes; a simulator that ticks fast publishes as much by right."""
    found = checks.check_floods(team_facts(loads=[Load("it", known, rates, size)], tick_rate=tick_rate))
    assert [finding.text.startswith(text or "-") for finding in found] == [True] * (text is not None)

"""The navigation process: one robot or several, each with its localiser, costmaps, planner and controller.

In lock-step it takes part as one participant, under the name of its first robot, and holds the names of all of them.
"""

import math
from collections.abc import Mapping
from functools import partial
from typing import Any

import msgspec
import numpy as np

from zteam import messages, names
from zteam.bus import NoRequest
from zteam.bus.presence import Claim, own_info
from zteam.bus.transport import Handle, RawSample
from zteam.clock import monotonic
from zteam.config.robot_ids import format_robot_ids
from zteam.errors import DecodeError, UsageError, log
from zteam.messages.base import Base, BaseOverride, base_of, override_base
from zteam.navigation.client import GLOBAL_LOCALIZATION, GlobalLocalizationReply, GlobalLocalizationRequest
from zteam.navigation.planning.grid import GridMap
from zteam.navigation.planning.maps import map_grid
from zteam.navigation.planning.parameters import Parameters
from zteam.navigation.planning.planner import Planner
from zteam.navigation.process.inputs import Inputs, TeamTransforms
from zteam.navigation.process.outputs import Outputs
from zteam.navigation.process.robot import RobotNavigation
from zteam.node.node import Node
from zteam.node.working import Pauses
from zteam.robot.client import CANCEL, CancelReply, CancelRequest, navigation_query


class NavigationNode:
    """All robots of one process. Handlers of messages run under `node.changed`, and between steps."""

    def __init__(
        self, node: Node, parameters: Mapping[int, Parameters], overrides: Mapping[int, BaseOverride], seed: int
    ) -> None:
        """By robot: its parameters, and what holds instead of its `base_info`."""
        self._node, self._overrides = node, overrides
        self._bases: dict[int, Base] = {}
        self._planners: dict[str, Planner] = {}
        self._grid: GridMap | None = None
        self._stepped, self._pauses = 0, Pauses()
        self._period = min(1.0 / each.controller.controller_frequency for each in parameters.values())
        self._tick_length, self._waited = self._period, math.inf
        """Seconds until the next step, as far as that is known, and before the last one."""
        self._transforms = TeamTransforms(node)
        self._robots = {i: self._make_robot(i, each, seed) for i, each in parameters.items()}
        node.subscribe(names.MAP, messages.OccupancyGrid, self._on_map, latched=True)
        node.subscribe(names.all_robots_key(names.BASE_INFO), messages.BaseInfo, self._on_base_info, latched=True)
        node.need(self._lacks)
        node.on_time_reset(self._forget)
        self._claims = [Claim(node.bus, name) for name in map(names.navigation_name, parameters) if name != node.name]

    def _make_robot(self, robot_id: int, parameters: Parameters, seed: int) -> RobotNavigation:
        node = self._node
        key = str(parameters.planner_plugin)
        if key not in self._planners:
            # Shared: the memory of a search is as large as the map.
            self._planners[key] = parameters.make_planner()
        inputs = Inputs(robot_id, self._transforms, self._bases)
        outputs = Outputs(node, robot_id, parameters)
        robot = RobotNavigation(inputs, parameters, outputs, self._planners[key], seed * 10_000 + robot_id)
        self._listen(inputs, names.BASE_SCAN, messages.LaserScan)
        self._listen(inputs, names.ODOM, messages.Odometry)
        if parameters.localizer == "fake":
            inputs.every_tick.append(names.GROUND_TRUTH)
            self._listen(inputs, names.GROUND_TRUTH, messages.Odometry)
        self._listen(inputs, names.GOAL_POSE, messages.PoseStamped)
        _listen_for_unreadable_goals(node, inputs)
        self._listen(inputs, names.INITIAL_POSE, messages.PoseWithCovarianceStamped)
        self._listen(inputs, names.STATUS, messages.RobotStatus)
        info = navigation_query(robot_id, "info")
        node.bus.serve(info, NoRequest, lambda _: own_info(node.name, node.bus.instance, node.claim.start))
        self._serve_changes(robot_id, robot)
        return robot

    def _listen(self, inputs: Inputs, topic: str, kind: type[messages.Message]) -> None:
        def on_message(_key: str, message: Any) -> None:
            inputs.newest[topic] = message
            if topic == names.STATUS:
                inputs.heard = None if self._node.ticks_tell_time else monotonic()

        self._node.subscribe(names.robot_key(inputs.robot_id, topic), kind, on_message)

    def _serve_changes(self, robot_id: int, robot: RobotNavigation) -> None:
        def can_cancel(_: CancelRequest) -> tuple[CancelReply, bool]:
            # A goal that is about to come is canceled as well.
            return CancelReply(robot.has_goal), True

        def can_spread(_: GlobalLocalizationRequest) -> tuple[GlobalLocalizationReply, bool]:
            refused = robot.why_not_localized_globally()
            return GlobalLocalizationReply(refused), not refused

        def spread(_: GlobalLocalizationRequest) -> None:
            robot.localize_globally()

        serve, key = partial(self._node.serve_change, after_step=True), partial(navigation_query, robot_id)
        serve(key(CANCEL), CancelRequest, can_cancel, lambda _: robot.cancel())
        serve(key(GLOBAL_LOCALIZATION), GlobalLocalizationRequest, can_spread, spread)

    def _on_map(self, _key: str, message: messages.OccupancyGrid) -> None:
        try:
            grid = map_grid(message)
        except UsageError as error:
            log.warning("the map that has come does not count: %s", error)
            return
        if self._grid is not None and grid.frame == self._grid.frame and np.array_equal(grid.cells, self._grid.cells):
            return
        if self._grid is not None:
            log.info("another map has come: all goals are planned anew on it")
        self._grid = grid
        for robot in self._robots.values():
            robot.set_map(grid)

    def _on_base_info(self, key: str, message: messages.BaseInfo) -> None:
        robot_id = names.robot_id_of(key.partition("/")[0])
        if robot_id is None:
            return
        before = self._bases.get(robot_id)
        base = override_base(base_of(message), self._overrides.get(robot_id, BaseOverride()))
        self._bases[robot_id] = base
        changed = before is None or msgspec.structs.astuple(before) != msgspec.structs.astuple(base)
        if changed and robot_id in self._robots:
            self._robots[robot_id].set_base()

    def _lacks(self, tick: messages.Tick) -> list[str]:
        """Lock-step: what a step waits for besides the transforms."""
        if self._grid is None:
            return [names.MAP]
        stamp, there = messages.ns_from_time(tick.stamp), set(tick.robots.tolist())
        missing = [names.robot_key(i, names.BASE_INFO) for i in sorted(there - self._bases.keys())]
        for robot_id in sorted(there & self._robots.keys()):
            inputs = self._robots[robot_id].inputs
            late = [topic for topic in inputs.every_tick if inputs.stamp(topic) < stamp]
            missing += [names.robot_key(robot_id, topic) for topic in late]
        return missing

    def _forget(self) -> None:
        self._stepped = 0
        for robot in self._robots.values():
            robot.forget()

    def step(self, now: int) -> None:
        if 0 < self._stepped < now:
            # In real time one step may come late, and the next one is due all the same.
            waited, self._waited = self._waited, (now - self._stepped) / 1e9
            self._tick_length = min(1.0, waited, self._waited)
        self._stepped = now
        was_paused = self._pauses.take(now, self._tick_length, in_lockstep=self._node.ticks_tell_time)
        team = self._transforms.find_robots(now, self._bases)
        for robot in self._robots.values():
            if was_paused:
                robot.navigator.rest()
            robot.step(now, self._tick_length, team)
        for robot in self._robots.values():
            robot.show_costmaps(now)

    def run(self) -> None:
        for claim in self._claims:
            claim.win(self._node.stop.request)
            self._node.claim.under_name.append(Handle(claim.release))
        self._node.on_stop(self._halt)
        log.info("navigation of robot %s: waiting for its map and data", format_robot_ids(self._robots))
        self._transforms.ask()
        self._node.run(self.step, period=self._period)

    def _halt(self) -> None:
        with self._node.changed:
            for robot in self._robots.values():
                robot.outputs.stop()


def _listen_for_unreadable_goals(node: Node, inputs: Inputs) -> None:
    """The bus drops a goal that cannot be read, such as one with NaN: the robot stops and says so all the same."""

    def check(sample: RawSample) -> None:
        if not isinstance(sample.content, bytes):
            return
        try:
            messages.decode(messages.PoseStamped, sample.content)
        except DecodeError as error:
            with node.changed:
                inputs.newest[names.GOAL_POSE] = str(error)

    node.bus.subscribe_raw(names.robot_key(inputs.robot_id, names.GOAL_POSE), check)

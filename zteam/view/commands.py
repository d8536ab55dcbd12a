"""What pages command besides driving. Goals of several robots that are sent to one place are spread around it."""

import hashlib
import math
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from zteam import names
from zteam.bus import Publisher
from zteam.clock import HOST_FACTOR, monotonic, pause
from zteam.config.toml_values import parse_value
from zteam.errors import BusError, ZteamError
from zteam.geometry import Pose2
from zteam.messages import Header, Message, OccupancyGrid, PoseStamped, PoseWithCovariance, PoseWithCovarianceStamped
from zteam.messages.planar import pose2_of, pose_message
from zteam.messages.std_msgs import time_from_ns
from zteam.robot import client
from zteam.robot.behaviors.formation import assign
from zteam.simulator.client import SimulatorClient
from zteam.view import frames, requests
from zteam.view.team_view import TeamView

SPACING = 0.9
"""Metres between two goals: the widest of the lectures' robots turns on the spot in this."""
MAX_ASSIGNED = 64
"""Robots whose ways are compared; the cubic search takes too long for more."""


def spread(
    goal: Pose2, poses: Mapping[int, Pose2], is_free: Callable[[float, float], bool] = lambda _x, _y: True
) -> dict[int, Pose2]:
    """A goal for each robot, with the heading of `goal`: the places nearest to it that are free, one of them itself.

    `poses` is where the robots are. The sum of the squares of their ways is least.
    """
    robots = sorted(poses)
    places = _nearest_places(goal, len(robots), is_free)
    order: Sequence[int] = range(len(robots))
    if len(robots) <= MAX_ASSIGNED:
        order = assign([[(p.x - poses[i].x) ** 2 + (p.y - poses[i].y) ** 2 for p in places] for i in robots])
    return {robot_id: places[place] for robot_id, place in zip(robots, order, strict=True)}


def _nearest_places(goal: Pose2, count: int, is_free: Callable[[float, float], bool]) -> list[Pose2]:
    found: list[Pose2] = []
    taken: list[Pose2] = []
    # Twice as far as an open floor needs: behind that, a place in a wall is no worse than one in another room.
    reach = 2 + 2 * math.ceil(math.sqrt(count))
    sides = range(-reach, reach + 1)
    grid = [(across + along / 2, along * math.sqrt(0.75)) for along in sides for across in sides]
    for x, y in sorted(grid, key=lambda point: math.hypot(*point)):
        place = goal.compose(Pose2(SPACING * x, SPACING * y, 0.0))
        (found if not found or is_free(place.x, place.y) else taken).append(place)
        if len(found) == count:
            return found
    return (found + taken)[:count]


class Tile(NamedTuple):
    """A piece of a grid, ready to be sent."""

    place: tuple[int, int, int, int]
    """Column, row, width, height in cells."""
    version: bytes
    """Another one for other cells."""
    block: bytes


def make_tiles(key: str, grid: OccupancyGrid, number: int, map_from_frame: Pose2, before: Sequence[Tile]) -> list[Tile]:
    """The tiles of a grid; those of `before` whose cells are the same are kept. `number` is that of its message."""
    info = grid.info
    if info.width * info.height != grid.data.size:
        return []
    cells = grid.data.reshape(info.height, info.width)
    origin = map_from_frame.compose(pose2_of(info.origin))
    meta = {
        "key": key, "width": info.width, "height": info.height, "resolution": info.resolution,
        "x": origin.x, "y": origin.y, "yaw": origin.yaw,
    }  # fmt: skip
    place_of_all = repr(meta).encode()
    kept = {tile.place: tile for tile in before}
    made = []
    for place in frames.tiles_of(info.width, info.height):
        column, row, width, height = place
        part = np.ascontiguousarray(cells[row : row + height, column : column + width])
        version = hashlib.blake2b(part.tobytes() + place_of_all, digest_size=8).digest()
        old = kept.get(place)
        if old is None or old.version != version:
            old = Tile(place, version, frames.encode_tile({**meta, "tile": place, "version": number}, part))
        made.append(old)
    return made


def room_in(grid: OccupancyGrid | None, radius: float) -> Callable[[float, float], bool]:
    """Whether all cells within `radius` (m) of a place in the grid are known to be free; without a grid all are."""
    if grid is None or grid.info.resolution <= 0.0 or grid.info.width * grid.info.height != grid.data.size:
        return lambda _x, _y: True
    info = grid.info
    cells = grid.data.reshape(info.height, info.width)
    grid_from_map = pose2_of(info.origin).inverse()
    reach = math.ceil(radius / info.resolution)

    def is_free(x: float, y: float) -> bool:
        place = grid_from_map.compose(Pose2(x, y, 0.0))
        column, row = math.floor(place.x / info.resolution), math.floor(place.y / info.resolution)
        if not (0 <= column < info.width and 0 <= row < info.height):
            return False
        near = cells[max(0, row - reach) : row + reach + 1, max(0, column - reach) : column + reach + 1]
        return bool((near == 0).all())

    return is_free


HEARD_WITHIN = 0.3 * HOST_FACTOR
"""Host seconds for a new publisher to learn of its subscribers."""
ROOM = 0.3
"""Metres around a goal that have to be free."""
POSITION_VARIANCE, YAW_VARIANCE = 0.25, (math.pi / 12) ** 2
"""m² and rad² of an initial pose, as RViz sends them."""


class Commands:
    """Threads may make calls at the same time."""

    def __init__(self, state: TeamView) -> None:
        self._state = state
        self._publishers: dict[str, Publisher[Message]] = {}
        self._lock = threading.Lock()
        bus = state.node.bus
        self._simulator, replay = (simulator := SimulatorClient(bus)), state.queries.change_replay
        stops, set_parameters = client.StopClient(bus, state.queries.names), client.ParametersClient(bus).set
        self._acts: Mapping[str, Callable[[Any], object]] = {
            "stop_robots": lambda _: client.need_done(stops.engage()),
            "release_robots": lambda _: client.need_done(stops.release()),
            "goal": self._send_goals,
            "cancel": self._cancel_goals,
            "resume_lists": lambda _: client.pause_lists(bus, paused=False),
            "initialpose": self._send_initial_pose,
            "pause": lambda _: simulator.pause(),
            "resume": lambda _: simulator.resume(),
            # It may take long: the page sees the tick.
            "step": lambda it: simulator.begin_steps(it.ticks),
            "speed": lambda it: simulator.set_speed(it.factor or None),
            "reset": lambda _: simulator.reset(),
            "spawn": self._spawn,
            "remove": lambda it: self._remove(it.robot),
            "move": lambda it: simulator.move(it.robot, it.x, it.y, it.yaw),
            "start": lambda it: client.start_robot(bus, it.robot, it.behavior),
            "parameter": lambda it: set_parameters(names.robot_name(it.robot), {it.name: parse_value(it.value)}),
            "doctor": lambda _: state.diagnosis.start(),
            "replay_pause": lambda _: replay(lambda client: client.pause()),
            "replay_resume": lambda _: replay(lambda client: client.resume()),
            "replay_seek": lambda it: replay(lambda client: client.seek(it.time)),
            "replay_step": lambda it: replay(lambda client: client.step(it.ticks)),
            "replay_speed": lambda it: replay(lambda client: client.set_speed(it.factor)),
        }

    def carry_out(self, request: requests.Command) -> str:
        """Do it; why not, if it cannot be done."""
        try:
            self._acts[request.op](request)
        except ZteamError as error:
            return str(error)
        finally:
            self._state.ask_soon()
        return ""

    def _spawn(self, request: requests.Spawn) -> None:
        robot_id = self._simulator.spawn(request.x, request.y, request.yaw, model=request.model)
        if request.behavior:
            try:
                client.start_robot(self._state.node.bus, robot_id, request.behavior)
            except ZteamError as error:
                raise ZteamError(f"{names.robot_name(robot_id)} stands there, without a behaviour: {error}") from None

    def _remove(self, robot_id: int) -> None:
        """Take a robot out of the world, and have its process ended. Raises ZteamError, also if that is left."""
        self._simulator.remove(robot_id)
        name, queries = names.robot_name(robot_id), self._state.queries
        if queries.alive(name) and queries.alive(names.LAUNCHER):
            client.start_robot(self._state.node.bus, robot_id, ends=True)
        elif queries.alive(name):
            raise ZteamError(f"it is out of the world, and its process {name} still runs: end it where it was started")

    def _send_goals(self, request: requests.Goal) -> None:
        known = self._state.poses
        goal = Pose2(request.x, request.y, request.yaw)
        poses = {robot_id: known.get(robot_id, goal) for robot_id in request.robots}
        grid = self._state.received.read(names.MAP, OccupancyGrid)
        is_free = room_in(grid and grid[1], ROOM)
        unheard = []
        for robot_id, place in spread(goal, poses, is_free).items():
            message = PoseStamped(self._header(), pose_message(place))
            key = names.robot_key(robot_id, names.GOAL_POSE)
            if self._publish(key, message):
                # A session does not hear itself.
                self._state.received.take(key, message)
            else:
                unheard.append(names.robot_name(robot_id))
        if unheard:
            text = f"nothing takes goals for {', '.join(unheard)}: use navigation, or a behaviour such as go_to"
            raise ZteamError(text)

    def _cancel_goals(self, request: requests.CancelGoals) -> None:
        # A list may have sent a goal that the page has not seen.
        others = client.pause_lists(self._state.node.bus, paused=True) if request.pauses else []
        robots = [*dict.fromkeys((*request.robots, *others))]
        # Many at once: each robot that hangs takes its time to say nothing.
        with ThreadPoolExecutor(16, "cancel") as threads:
            answers = zip(robots, threads.map(self._cancel_goal, robots), strict=True)
            problems = [problem for robot_id, problem in answers if problem and robot_id in request.robots]
        if problems:
            raise ZteamError("; ".join(problems))

    def _cancel_goal(self, robot_id: int) -> str:
        """Why a goal cannot be given up; empty if it is."""
        name, sim, bus = names.robot_name(robot_id), self._state.queries.sim, self._state.node.bus
        key, limit = client.navigation_query(robot_id, client.CANCEL), client.CANCEL_LIMIT
        try:
            answers = bus.query(key, client.CancelReply, client.CancelRequest(), timeout=limit)
        except BusError as error:
            return str(error)
        if not answers:
            return f"nothing that takes goals answers for {name}"
        if any(answer.canceled for _, answer in answers):
            return ""
        why = ": the world is paused, and it has not taken its goal yet" if sim is not None and sim.paused else ""
        return f"{name} has no goal to give up{why}"

    def _send_initial_pose(self, request: requests.Placed) -> None:
        pose = PoseWithCovariance(pose_message(Pose2(request.x, request.y, request.yaw)))
        pose.covariance = pose.covariance.copy()
        pose.covariance[[0, 7, 35]] = POSITION_VARIANCE, POSITION_VARIANCE, YAW_VARIANCE
        key = names.robot_key(request.robot, names.INITIAL_POSE)
        if not self._publish(key, PoseWithCovarianceStamped(self._header(), pose)):
            raise ZteamError(f"nothing hears {key}")

    def _header(self) -> Header:
        return Header(time_from_ns(self._state.places.stamp), names.MAP_FRAME)

    def _publish(self, key: str, message: Message) -> bool:
        """Send a message; whether something hears it. Raises BusError if this process may not."""
        with self._lock:
            publisher = self._publishers.get(key)
            if publisher is None:
                self._state.node.bus.check_right(key)
                publisher = self._state.node.bus.publisher(key, type(message), to_others=True)
                self._publishers[key] = publisher
        end = monotonic() + HEARD_WITHIN
        while not publisher.has_subscribers:
            if monotonic() > end:
                return False
            pause(0.01)
        publisher.put(message)
        return True

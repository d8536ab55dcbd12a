"""What pages command besides driving, carried out on threads that may wait; errors become the text of the reply."""

import math
import threading
from typing import TypeVar

from zteam import names
from zteam.bus import Bus, Publisher
from zteam.clock import monotonic, pause
from zteam.errors import ZteamError
from zteam.geometry import Pose2, quaternion_from_yaw
from zteam.messages import (
    Header,
    Message,
    Point,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
    time_from_ns,
)
from zteam.nodes.web import requests
from zteam.nodes.web.goals import spread
from zteam.nodes.web.grids import room_in
from zteam.nodes.web.hub import Hub
from zteam.services.simulator import SimStatus, StepRequest
from zteam.services.simulator_client import SimulatorClient

M = TypeVar("M", bound=Message)

HEARD_WITHIN = 0.3
"""Host seconds for a new publisher to learn of its subscribers."""
ROOM = 0.3
"""Metres around a goal that have to be free."""
POSITION_VARIANCE, YAW_VARIANCE = 0.25, (math.pi / 12) ** 2
"""m² and rad² of an initial pose, as RViz sends them."""
_HINT = " (--force puts it there)"


class Commands:
    """Threads may make calls at the same time."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._simulator = SimulatorClient(hub.node.bus)
        self._publishers: dict[str, Publisher[Message]] = {}
        self._lock = threading.Lock()

    def carry_out(self, request: requests.Command) -> str:
        """Do it; why not, if it cannot be done."""
        try:
            self._act(request)
        except ZteamError as error:
            return str(error).removesuffix(_HINT)
        finally:
            self._hub.ask_soon()
        return ""

    def _act(self, request: requests.Command) -> None:
        simulator = self._simulator
        match request:
            case requests.Goal():
                self._send_goals(request)
            case requests.InitialPose():
                self._send_initial_pose(request)
            case requests.Pause():
                simulator.pause()
            case requests.Resume():
                simulator.resume()
            case requests.Step():
                # It may take long: the page sees the tick.
                key = names.service_key(names.SIMULATOR, "step")
                self._bus.ask(key, SimStatus, StepRequest(request.ticks, wait=False))
            case requests.SetSpeed():
                simulator.set_speed(request.factor or None)
            case requests.Reset():
                simulator.reset()
            case requests.Spawn():
                simulator.spawn(request.x, request.y, request.yaw, model=request.model)
            case requests.Remove():
                simulator.remove(request.robot)
            case requests.Move():
                simulator.move(request.robot, request.x, request.y, request.yaw)
            case _:
                raise ZteamError("this is no command")

    @property
    def _bus(self) -> Bus:
        return self._hub.node.bus

    def _send_goals(self, request: requests.Goal) -> None:
        known = self._hub.poses
        goal = Pose2(request.x, request.y, request.yaw)
        poses = {robot_id: known.get(robot_id, goal) for robot_id in request.robots}
        arrival = self._hub.newest.get(names.MAP)
        is_free = _everywhere if arrival is None else room_in(arrival.content, ROOM)
        unheard = []
        for robot_id, place in spread(goal, poses, is_free).items():
            message = PoseStamped(self._header(), _pose(place))
            key = names.robot_key(robot_id, names.GOAL_POSE)
            try:
                self._publish(key, message)
            except ZteamError:
                unheard.append(names.robot_name(robot_id))
                continue
            # A session does not hear itself.
            self._hub.newest.take(key, message)
        if unheard:
            raise ZteamError(f"no goal is heard by {', '.join(unheard)}: behaviours such as go_to take them")

    def _send_initial_pose(self, request: requests.InitialPose) -> None:
        pose = PoseWithCovariance(_pose(Pose2(request.x, request.y, request.yaw)))
        pose.covariance = pose.covariance.copy()
        pose.covariance[[0, 7, 35]] = POSITION_VARIANCE, POSITION_VARIANCE, YAW_VARIANCE
        key = names.robot_key(request.robot, names.INITIAL_POSE)
        self._publish(key, PoseWithCovarianceStamped(self._header(), pose))

    def _header(self) -> Header:
        return Header(time_from_ns(self._hub.places.stamp), names.MAP_FRAME)

    def _publish(self, key: str, message: Message) -> None:
        """Send a message. Raises ZteamError if nothing hears it."""
        with self._lock:
            publisher = self._publishers.get(key)
            if publisher is None:
                publisher = self._bus.publisher(key, type(message), to_others=True)
                self._publishers[key] = publisher
        end = monotonic() + HEARD_WITHIN
        while not publisher.has_subscribers and monotonic() < end:
            pause(0.01)
        if not publisher.has_subscribers:
            raise ZteamError(f"nothing hears {key}")
        publisher.put(message)


def _everywhere(_x: float, _y: float) -> bool:
    return True


def _pose(place: Pose2) -> Pose:
    return Pose(Point(place.x, place.y), Quaternion(*quaternion_from_yaw(place.yaw)))

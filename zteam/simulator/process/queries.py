"""The simulator's queries `sim/…`: status and report, the pace, changes of the world, and what a view draws of it."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any, TypeVar

from zteam import names
from zteam.bus import Bus, Change, Deferred, NoRequest
from zteam.errors import BusError
from zteam.simulator.client import (
    BOUNDARY_LIMIT,
    FaultRequest,
    FinishReply,
    MoveRequest,
    ObstacleShape,
    ObstaclesReply,
    RemoveRequest,
    ResetRequest,
    RobotShape,
    ScansRequest,
    ShapesReply,
    SimStatus,
    SpawnReply,
    SpawnRequest,
    SpeedRequest,
    StandReply,
    StepRequest,
    WaitRequest,
)
from zteam.simulator.core import Engine
from zteam.simulator.process.simulation import Simulation
from zteam.simulator.world import Obstacle, Robot, Shape, World

T = TypeVar("T")

_DIGITS = 4
"""Of a metre, in shapes: a tenth of a millimetre is finer than any screen."""


class Queries:
    """Serves `sim/…`. A bus thread runs each query; the main loop makes the changes, between two ticks."""

    def __init__(self, bus: Bus, simulation: Simulation) -> None:
        self._bus, self._simulation, self._boundary = bus, simulation, simulation.boundary
        pacer, boundary = simulation.pacer, simulation.boundary
        self._serve("status", NoRequest, lambda _: simulation.status())
        self._serve("report", NoRequest, lambda _: simulation.report())
        self._serve("pause", Change, lambda _: self._set_pace(pacer.pause))
        self._serve("resume", Change, lambda _: self._set_pace(pacer.resume))
        self._serve("speed", SpeedRequest, lambda request: self._set_pace(lambda: pacer.set_speed(request.speed)))
        self._serve("step", StepRequest, self._step)
        self._serve("stand", WaitRequest, lambda request: Deferred(lambda: self._stand(request.timeout)))
        self._serve(
            "finish", WaitRequest,
            lambda request: Deferred(lambda: FinishReply(boundary.wait_until_finished(request.timeout))),
        )  # fmt: skip
        self._serve_change("repeat", Change, lambda _: simulation.repeat())
        # Nothing changes, but only between two ticks does what was sent stay as it is.
        self._serve_change("scans", ScansRequest, lambda request: simulation.scans(request.robots))
        self._serve_change("reset", ResetRequest, lambda request: simulation.reset(anew=request.anew))
        self._serve_change("spawn", SpawnRequest, lambda request: SpawnReply(simulation.spawn(request)))
        self._serve_change("remove", RemoveRequest, lambda request: simulation.remove(request.id))
        self._serve_change("fault", FaultRequest, lambda request: simulation.add_fault(request))
        self._serve_change("move", MoveRequest, simulation.move)

    def _serve(self, service: str, request_type: Any, answer: Callable[[Any], Any]) -> None:
        self._bus.serve(names.service_key(names.SIMULATOR, service), request_type, answer)

    def _serve_change(self, service: str, request_type: Any, make: Callable[[Any], Any]) -> None:
        """Answer with what `make` returns, or with the status afterwards."""

        def answer(request: Any) -> Deferred:
            future = self._boundary.submit(lambda: make(request) or self._simulation.status())
            return Deferred(lambda: _result_of(future))

        self._serve(service, request_type, answer)

    def _set_pace(self, change: Callable[[], None]) -> SimStatus:
        self._boundary.set_pace(change)
        return self._simulation.status()

    def _step(self, request: StepRequest) -> SimStatus | Deferred:
        if self._boundary.finished:
            raise BusError("the run is over: 'zteam sim reset' starts it again")
        status = self._set_pace(lambda: self._simulation.pacer.step(request.ticks))
        if not request.wait:
            return status

        def stand() -> SimStatus:
            self._boundary.wait_for_steps()
            return self._simulation.status()

        return Deferred(stand)

    def _stand(self, timeout: float) -> StandReply:
        return StandReply(self._boundary.wait_until_standing(timeout), self._simulation.status())


def _result_of(change: Future[T]) -> T:
    """The result of a change. Raises its ZteamError, or BusError if the open tick does not end in time."""
    try:
        return change.result(BOUNDARY_LIMIT)
    except TimeoutError:
        text = f"the tick at hand did not end within {BOUNDARY_LIMIT:g} s: see 'zteam sim status'"
        raise BusError(text) from None


def serve_shapes(bus: Bus, world: World, engine: Engine) -> None:
    """Serve both queries. They are answered from what is there, during a tick too."""

    def shapes(_: NoRequest) -> ShapesReply:
        robots = {robot_id: _robot_shape(robot) for robot_id, robot in list(engine.robots.items())}
        return ShapesReply(robots, sorted({*world.templates, "erratic"}))

    def obstacles(_: NoRequest) -> ObstaclesReply:
        return ObstaclesReply([_obstacle_shape(obstacle) for obstacle in engine.obstacles()])

    bus.serve(names.service_key(names.SIMULATOR, "shapes"), NoRequest, shapes)
    bus.serve(names.service_key(names.SIMULATOR, "obstacles"), NoRequest, obstacles)


def _robot_shape(robot: Robot) -> RobotShape:
    """A robot from above: its polygons from the ground up, and its lasers."""
    shapes = sorted(robot.shapes, key=lambda shape: shape.z_max)
    lasers = [(ranger.x, ranger.y, ranger.yaw) for ranger in robot.rangers if ranger.is_laser]
    return RobotShape(robot.model, _outline(shapes), lasers)


def _obstacle_shape(obstacle: Obstacle) -> ObstacleShape:
    pose = obstacle.pose
    movable = obstacle.mass is not None
    return ObstacleShape(obstacle.name, pose.x, pose.y, pose.yaw, _outline(obstacle.shapes), movable)


def _outline(shapes: Sequence[Shape]) -> list[list[tuple[float, float]]]:
    return [[(round(x, _DIGITS), round(y, _DIGITS)) for x, y in shape.points] for shape in shapes]

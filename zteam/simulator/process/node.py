"""The simulator process: it steps the engine, publishes what the robots sense, and takes their commands.

A tick: commands in, bodies move, transforms and odometry out, lasers are cast, scans out (`Simulation.tick`), and then
everything else (`Simulation.send_rest`). In lock-step the next tick begins when every participant has answered and it
is due; in real time when it is due (`run_ticks`).
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from zteam import names
from zteam.bus import Bus, Change, Deferred, NoRequest
from zteam.clock import FREEZES, Every
from zteam.config.numbers import counted
from zteam.config.simulation_options import SimOptions
from zteam.errors import BusError, log
from zteam.messages import OccupancyGrid, Twist
from zteam.node.process_node import ProcessNode
from zteam.simulator import client
from zteam.simulator.core import Engine
from zteam.simulator.core.occupancy_grid import map_message
from zteam.simulator.process.simulation import Simulation
from zteam.simulator.world import Robot, Shape, World

_DIGITS = 4
"""Of a metre, in shapes: a tenth of a millimetre is finer than any screen."""


def run_simulator(node: ProcessNode, world: World, robots: dict[int, Robot], options: SimOptions) -> None:
    simulation = open_simulation(node, world, robots, options)
    node.become_present()
    size, period = counted(len(robots), "robot"), world.interval / 1e6
    mode = ", in lock-step" * (options.lockstep is not None) + ", paused" * options.paused
    log.info("%s: %s, a tick every %g ms%s", world.name, size, period, mode)
    run_ticks(simulation)


def open_simulation(node: ProcessNode, world: World, robots: Mapping[int, Robot], options: SimOptions) -> Simulation:
    """A simulation with its queries and its latched messages: every robot's fixed frames, and the map."""
    simulation = Simulation(node, world, robots, options)
    serve_shapes(node.bus, world, simulation.engine)
    serve_queries(node.bus, simulation)
    simulation.match_robots()
    if options.has_map:
        grid = node.bus.publisher(names.MAP, OccupancyGrid, latched=True)
        grid.put(map_message(world, options.engine.map_resolution))
    return simulation


def run_ticks(simulation: Simulation) -> None:
    """Tick until the process is asked to stop."""
    profile, pacer, lockstep = simulation.profile, simulation.pacer, simulation.lockstep
    behind, woke = Every(5.0), FREEZES.look()
    commands: dict[int, Twist] = {}
    while True:
        simulation.tick(commands)
        # Before the clock: a process that hears the last tick's clock may ask for the report at once.
        simulation.count()
        simulation.send_rest()
        if lockstep is not None and not lockstep.wait(simulation.repeat):
            return
        profile.end("wait")
        if simulation.statistics.go_stamp is None:
            # GO may have come while the first tick was held.
            simulation.count()
        if not simulation.boundary.wait_for_tick():
            return
        profile.end("idle")
        commands = simulation.take_commands()
        profile.end_tick()
        if (latest := FREEZES.look()) > woke or (lockstep is not None and lockstep.was_held):
            woke = latest
            pacer.start_anew()
        elif pacer.behind and not FREEZES.has_just_woken() and behind.due():
            log.warning("real-time factor %.2g: %s", pacer.factor, profile.last_text())


def serve_queries(bus: Bus, simulation: Simulation) -> None:
    """Serve `sim/…`. A bus thread runs each query; the main loop makes the changes, between two ticks."""
    pacer, boundary = simulation.pacer, simulation.boundary

    def serve(service: str, request_type: Any, answer: Callable[[Any], Any]) -> None:
        bus.serve(names.service_key(names.SIMULATOR, service), request_type, answer)

    def serve_change(service: str, request_type: Any, make: Callable[[Any], Any]) -> None:
        """Answer with what `make` returns, or with the status afterwards; with an error if the tick does not end."""

        def answer(request: Any) -> Deferred:
            future = boundary.submit(lambda: make(request) or simulation.status())

            def result() -> Any:
                try:
                    return future.result(client.BOUNDARY_LIMIT)
                except TimeoutError:
                    text = f"the tick at hand did not end within {client.BOUNDARY_LIMIT:g} s: see 'zteam sim status'"
                    raise BusError(text) from None

            return Deferred(result)

        serve(service, request_type, answer)

    def set_pace(change: Callable[[], None]) -> client.SimStatus:
        boundary.set_pace(change)
        return simulation.status()

    def step(request: client.StepRequest) -> client.SimStatus | Deferred:
        def stand_still() -> client.SimStatus:
            boundary.wait(lambda: not pacer.paused or boundary.stands())
            return simulation.status()

        if boundary.finished:
            raise BusError("the run is over: 'zteam sim reset' starts it again")
        status = set_pace(lambda: pacer.step(request.ticks))
        return Deferred(stand_still) if request.wait else status

    def stand(request: client.WaitRequest) -> Deferred:
        return Deferred(lambda: client.StandReply(boundary.wait(boundary.stands, request.timeout), simulation.status()))

    def finish(request: client.WaitRequest) -> Deferred:
        return Deferred(lambda: client.FinishReply(boundary.wait(lambda: boundary.finished, request.timeout)))

    serve("status", NoRequest, lambda _: simulation.status())
    serve("report", NoRequest, lambda _: simulation.report())
    serve("pause", Change, lambda _: set_pace(pacer.pause))
    serve("resume", Change, lambda _: set_pace(pacer.resume))
    serve("speed", client.SpeedRequest, lambda request: set_pace(lambda: pacer.set_speed(request.speed)))
    serve("step", client.StepRequest, step)
    serve("stand", client.WaitRequest, stand)
    serve("finish", client.WaitRequest, finish)
    serve_change("repeat", Change, lambda _: simulation.repeat())
    # Nothing changes, but only between two ticks does what was sent stay as it is.
    serve_change("scans", client.ScansRequest, lambda request: simulation.scans(request.robots))
    serve_change("reset", Change, lambda _: simulation.reset())
    serve_change("spawn", client.SpawnRequest, lambda request: client.SpawnReply(simulation.spawn(request)))
    serve_change("remove", client.RemoveRequest, lambda request: simulation.remove(request.id))
    serve_change("fault", client.FaultRequest, lambda request: simulation.add_fault(request))
    serve_change("move", client.MoveRequest, simulation.move)


def serve_shapes(bus: Bus, world: World, engine: Engine) -> None:
    """Serve both queries. They are answered from what is there, during a tick too."""

    def robot_shape(robot: Robot) -> client.RobotShape:
        lasers = [(ranger.x, ranger.y, ranger.yaw) for ranger in robot.rangers if ranger.is_laser]
        return client.RobotShape(robot.model, _outline(sorted(robot.shapes, key=lambda each: each.z_max)), lasers)

    def shapes(_: NoRequest) -> client.ShapesReply:
        robots = {robot_id: robot_shape(robot) for robot_id, robot in list(engine.robots.items())}
        return client.ShapesReply(robots, sorted({*world.templates, "erratic"}))

    def obstacles(_: NoRequest) -> client.ObstaclesReply:
        now = engine.obstacles()
        found = [client.ObstacleShape(o.name, *o.pose, _outline(o.shapes), o.mass is not None) for o in now]
        return client.ObstaclesReply(found)

    bus.serve(names.service_key(names.SIMULATOR, "shapes"), NoRequest, shapes)
    bus.serve(names.service_key(names.SIMULATOR, "obstacles"), NoRequest, obstacles)


def _outline(shapes: Sequence[Shape]) -> list[list[tuple[float, float]]]:
    return [[(round(x, _DIGITS), round(y, _DIGITS)) for x, y in shape.points] for shape in shapes]

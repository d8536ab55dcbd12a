"""The simulator process: it steps the engine, publishes what the robots sense, and takes their commands.

A tick: commands in, bodies move, transforms and odometry out, lasers are cast, scans out (`Simulation.tick`), and then
everything else (`Simulation.send_rest`). In lock-step the next tick begins when every participant has answered and it
is due; in real time when it is due (`run_ticks`).
"""

import logging
from collections.abc import Mapping

from zteam import names
from zteam.clock import FREEZES, Every
from zteam.config.numbers import counted
from zteam.config.robot_ids import format_robot_ids
from zteam.config.simulation_options import SimOptions
from zteam.messages import OccupancyGrid, Twist
from zteam.node.process_node import ProcessNode
from zteam.simulator.core.occupancy_grid import map_message
from zteam.simulator.process.queries import serve_queries, serve_shapes
from zteam.simulator.process.simulation import Simulation
from zteam.simulator.world import Robot, World

log = logging.getLogger("zteam")


def _hold_text(options: SimOptions) -> str:
    """What the first tick waits for, as the end of a sentence."""
    lockstep = options.lockstep
    awaited = [] if lockstep is None else [*lockstep.expected, *(["the monitor's GO"] if lockstep.gate else [])]
    held = f", lock-step: the first tick waits for {', '.join(awaited)}" if awaited else ""
    return f"{held}{', paused' if options.paused else ''}"


def run_simulator(node: ProcessNode, world: World, robots: dict[int, Robot], options: SimOptions) -> None:
    for pair in options.follows.items():
        if not set(pair) <= robots.keys():
            log.warning(
                "--gap %d:%d is measured once both robots are there: the world has %s",
                *pair, format_robot_ids(sorted(robots)) or "no robot",
            )  # fmt: skip
    simulation = open_simulation(node, world, robots, options)
    node.become_present()
    size, period = counted(len(robots), "robot"), world.interval / 1e6
    log.info("%s: %s, a tick every %g ms%s", world.name, size, period, _hold_text(options))
    run_ticks(simulation)


def open_simulation(node: ProcessNode, world: World, robots: Mapping[int, Robot], options: SimOptions) -> Simulation:
    """A simulation with its queries and its latched messages: every robot's fixed frames, and the map."""
    simulation = Simulation(node, world, robots, options)
    serve_shapes(node.bus, world, simulation.engine)
    serve_queries(node.bus, simulation)
    simulation.match_robots()
    if options.has_map:
        grid = node.bus.publisher(names.MAP, OccupancyGrid, latched=True)
        grid.put(map_message(world, options.map_resolution))
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
        if not simulation.is_counting:
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

"""The changes of the world that queries ask for. The main loop makes them, between two ticks."""

from collections.abc import Callable, Iterable

from zteam import names
from zteam.geometry import Pose2
from zteam.messages import encode
from zteam.nodes.simulator.team_outputs import TeamOutputs
from zteam.nodes.simulator.tick_sender import TickSender
from zteam.services.scans import ScansReply, SensedScan
from zteam.services.simulator import MoveRequest, SpawnRequest
from zteam.sim import Engine
from zteam.world import World, add_robot


class WorldChanges:
    """Changes the engine, and tells the parts of the simulator that depend on it."""

    def __init__(
        self,
        world: World,
        engine: Engine,
        outputs: TeamOutputs,
        sender: TickSender,
        on_reset: Iterable[Callable[[], None]],
        on_change: Callable[[], None] = lambda: None,
    ) -> None:
        """`reset` calls everything in `on_reset` when the engine is back at its start.

        `on_change()` is called when a robot was added, removed or moved.
        """
        self._world, self._engine, self._outputs, self._sender = world, engine, outputs, sender
        self._on_reset = tuple(on_reset)
        self._on_change = on_change

    def repeat(self) -> None:
        """Send the last tick's data again."""
        self._sender.repeat()

    def scans(self, robots: Iterable[int]) -> ScansReply:
        """What the lasers of these robots saw in the last tick."""
        return ScansReply([SensedScan(key, encode(scan)) for key, scan in self._sender.scans(robots)])

    def reset(self) -> None:
        """Put everything back to the start; GO stays given."""
        self._engine.reset()
        self._outputs.match_robots()
        for robot_id in self._outputs:
            self._outputs.put_statics(robot_id)
        for start_anew in self._on_reset:
            start_anew()

    def spawn(self, request: SpawnRequest) -> int:
        """Add a robot and return its id. Raises UsageError."""
        robots = self._engine.robots
        free = next(i for i in range(names.MAX_ROBOT_ID + 1) if i not in robots)
        robot_id = free if request.id is None else request.id
        robot = add_robot(self._world, request.model, _pose(request), names.robot_name(robot_id))
        self._engine.spawn(robot_id, robot, checked=not request.force)
        self._outputs.match_robots()
        self._on_change()
        return robot_id

    def remove(self, robot_id: int) -> None:
        """Take a robot out of the world. Raises UsageError."""
        self._engine.remove(robot_id)
        self._outputs.match_robots()
        self._on_change()

    def move(self, request: MoveRequest) -> None:
        """Put a robot at another pose. Raises UsageError."""
        self._engine.place(request.id, _pose(request), checked=not request.force)
        self._outputs.put_statics(request.id)
        self._on_change()


def _pose(request: SpawnRequest | MoveRequest) -> Pose2:
    return Pose2(request.x, request.y, request.yaw)

"""A team of robots in which every robot, the 2-D simulator and the tools are processes linked by Zenoh.

A behaviour of your own decides what a robot does. Put it into a file `my_robot.py`:

    from zteam import Behavior
    from zteam.messages import Twist, Vector3

    class Circle(Behavior):
        def step(self, view):
            return Twist(Vector3(0.3), Vector3(0.0, 0.0, 0.4))

and run it with `zteam-robot --id 0 --behavior my_robot:Circle`, or name it in a team file that `zteam up` starts.
`view` is a `View`: the time, the scan, the odometry, and where the other robots are.

A process of your own subscribes, publishes, and keeps time with the team:

    import zteam
    from zteam.messages import Bool, LaserScan

    def main(node):
        near = node.publisher("robot_0/near", Bool)
        node.subscribe("robot_0/base_scan", LaserScan, lambda key, scan: near.put(Bool(scan.ranges.min() < 1.0)))
        node.run(lambda now: None)

    zteam.run("watchdog", main)

A script asks the running simulator, or looks up transforms:

    bus = zteam.connect(zteam.BusOptions.from_environment())
    zteam.SimulatorClient(bus).pause()
    zteam.TransformClient(bus).lookup_transform("map", "robot_0/base_footprint", timeout=1.0)
    bus.close()

A program sends a robot to goals, with the names of Nav2's simple commander:

    with zteam.BasicNavigator("robot_1") as navigator:
        navigator.goToPose(zteam.Pose2(22.0, 17.0, 0.0))
        while not navigator.isTaskComplete():
            print(navigator.getFeedback())
        print(navigator.getResult(), navigator.reason)

A whole team also runs in a program of your own, without any other process:

    report = zteam.run_team("line", seconds=60.0, seed=3)
    print(report.trajectory_sha256, [robot.distance_m for robot in report.robots])

What `zteam up --record run.mcap` has recorded comes back as messages, or as columns for pandas:

    recording = zteam.Recording("run.mcap")
    print(recording.report.seconds, recording.table("robot_0/odom")["pose.pose.position.x"].max())

A test starts a whole team with the pytest fixture `team`, or runs a node or a behaviour by itself with `zteam.testing`.

Public packages:

    zteam.messages   message types under their ROS 2 names, and their bytes
    zteam.behaviors  the base class of behaviours, and reading laser scans
    zteam.sim        the simulator as a Python object
    zteam.world      Stage's world files
    zteam.tf         tf2's buffer of transforms
    zteam.testing    nodes and behaviours in a test's own process
    zteam.errors     the errors that zteam raises; ZteamError is the base of all

Every other module is internal and may change at any time. Units are SI and radians, stamps are integer nanoseconds.
Errors go to the logger "zteam"; `logging.basicConfig(level="INFO")` shows its other messages as well.
"""

from zteam.version import __version__ as __version__

# Not typing's own: a command is deaf to Ctrl+C until the imports of this module are done.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from zteam.bus import Bus as Bus
    from zteam.bus import BusOptions as BusOptions
    from zteam.bus import Change as Change
    from zteam.bus import Deferred as Deferred
    from zteam.bus import NoRequest as NoRequest
    from zteam.bus import Publisher as Publisher
    from zteam.bus import connect as connect
    from zteam.config.resources import shipped_team as shipped_team
    from zteam.config.resources import shipped_world as shipped_world
    from zteam.errors import ZteamError as ZteamError
    from zteam.geometry import Pose2 as Pose2
    from zteam.navigation.basic_navigator import BasicNavigator as BasicNavigator
    from zteam.navigation.client import TaskResult as TaskResult
    from zteam.node.node import Node as Node
    from zteam.node.node import run as run
    from zteam.record.recording import Recording as Recording
    from zteam.robot.behaviors.behavior import Behavior as Behavior
    from zteam.robot.client import ParametersClient as ParametersClient
    from zteam.robot.view import View as View
    from zteam.simulator.client import SimulatorClient as SimulatorClient
    from zteam.team.file.entries import Team as Team
    from zteam.team.file.reading import load_team as load_team
    from zteam.team.run.report import RunReport as RunReport
    from zteam.team.run.run_team import run_team as run_team
    from zteam.transforms.client import HistoryRequest as HistoryRequest
    from zteam.transforms.client import Lookup as Lookup
    from zteam.transforms.client import TransformClient as TransformClient
    from zteam.transforms.listener import TransformListener as TransformListener

_NAMES = {
    "bus": ["Bus", "BusOptions", "Change", "Deferred", "NoRequest", "Publisher", "connect"],
    "config.resources": ["shipped_team", "shipped_world"],
    "errors": ["ZteamError"],
    "geometry": ["Pose2"],
    "navigation.basic_navigator": ["BasicNavigator"],
    "navigation.client": ["TaskResult"],
    "node.node": ["Node", "run"],
    "record.recording": ["Recording"],
    "robot.behaviors.behavior": ["Behavior"],
    "robot.client": ["ParametersClient"],
    "robot.view": ["View"],
    "simulator.client": ["SimulatorClient"],
    "team.file.entries": ["Team"],
    "team.file.reading": ["load_team"],
    "team.run.report": ["RunReport"],
    "team.run.run_team": ["run_team"],
    "transforms.client": ["HistoryRequest", "Lookup", "TransformClient"],
    "transforms.listener": ["TransformListener"],
}
"""What each module within zteam defines of these."""
_HOMES = {name: module for module, names in _NAMES.items() for name in names}
__all__ = sorted([*_HOMES, "__version__"])


def __getattr__(name: str) -> object:
    # Lazy: a program that wants only the simulator or the transforms does not pay for the bus.
    if name not in _HOMES:
        raise AttributeError(f"module 'zteam' has no attribute {name!r}")
    from importlib import import_module

    home = _HOMES[name]
    found = getattr(import_module(f"zteam.{home}"), name)
    if home != "errors":
        # Error texts and `help` name it as a user imports it.
        found.__module__ = "zteam"
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return __all__

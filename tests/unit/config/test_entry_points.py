"""What other installed packages offer: behaviours by name, message types by their ROS names."""

import importlib.metadata
import sys
from pathlib import Path

import pytest

from support.installed_packages import install
from zteam.behaviors import load_behavior
from zteam.config.entry_points import load_offered
from zteam.errors import UsageError
from zteam.messages import decode, encode, encoding_of, from_text, message_type, to_json, type_of_encoding
from zteam.messages.message import REGISTERED, import_offered

PATROL = """
    from zteam import Behavior
    from zteam.messages import Twist, Vector3

    class Patrol(Behavior):
        def step(self, view):
            return Twist(Vector3(0.3))

    text = "not a behaviour"
"""
BATTERY = """
    import msgspec
    from zteam.messages import Float32Seq, Header, Message, float32

    class Cell(Message):
        ros_type = "acme_msgs/msg/Cell"
        volts: float32 = 0.0

    class Battery(Message):
        ros_type = "acme_msgs/msg/Battery"
        header: Header = msgspec.field(default_factory=Header)
        charge: float32 = 1.0
        name: str = ""
        cells: list[Cell] = msgspec.field(default_factory=list)
"""


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, own_types: None) -> Path:
    """A folder of installed packages, forgotten after the test, with the message types that it defined."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "modules", sys.modules.copy())
    return tmp_path


@pytest.fixture
def acme(site: Path) -> Path:
    """An installed package with a behaviour, three broken ones, and message types."""
    points = """
        [zteam.behaviors]
        acme_patrol = acme_robots:Patrol
        acme_text = acme_robots:text
        acme_gone = acme_robots:Gone
        acme_broken = acme_broken:Patrol

        [zteam.messages]
        acme_msgs = acme_messages
        broken_msgs = acme_broken
    """
    modules = {"acme_robots": PATROL, "acme_messages": BATTERY, "acme_broken": "raise SystemExit('no\\nlicence')"}
    install(site, "acme-robots", points, modules)
    return site


@pytest.mark.usefixtures("acme")
def test_an_installed_behaviour_is_found_by_its_name() -> None:
    """A name that a package offers is as good as one of zteam's own."""
    assert type(load_behavior("acme_patrol", {})).__qualname__ == "Patrol"
    with pytest.raises(UsageError, match="behaviour acme_patrol: speed: unknown key; acme_patrol takes no parameters"):
        load_behavior("acme_patrol", {"speed": 1.0})


@pytest.mark.usefixtures("acme")
@pytest.mark.parametrize(
    ("spec", "text"),
    [
        ("acme_patrl", r"no behaviour 'acme_patrl' \(did you mean acme_patrol\?\): use idle, .*, acme_patrol, "),
        ("acme_text", "behaviour 'acme_text' is not a subclass of zteam.behaviors.Behavior"),
        ("acme_gone", "cannot import acme_robots:Gone of acme-robots: AttributeError: "),
        ("acme_broken", "cannot import acme_broken:Patrol of acme-robots: SystemExit: no licence$"),
    ],
)
def test_what_cannot_be_used_says_why(spec: str, text: str) -> None:
    """A wrong name gets the nearest; an offer that cannot be imported, or is no behaviour, names its package."""
    with pytest.raises(UsageError, match=text):
        load_behavior(spec, {})


def test_a_name_that_two_packages_offer_is_refused(acme: Path) -> None:
    """Which of the two is meant cannot be told; the error names both packages."""
    install(acme, "zeta", "[zteam.behaviors]\nacme_patrol = zeta:Patrol\n", {"zeta": PATROL})
    with pytest.raises(UsageError, match=r"is offered by acme-robots \(acme_robots:Patrol\), zeta \(zeta:Patrol\)"):
        load_behavior("acme_patrol", {})


@pytest.mark.usefixtures("acme")
@pytest.mark.parametrize("name", ["acme_msgs/msg/Battery", "acme_msgs/Battery", "Battery"])
def test_an_installed_message_type_is_found_by_its_names(name: str) -> None:
    """Its package is imported when it is asked for, and the type travels as one of zteam's own does. Tools find it
    by its encoding as well."""
    assert "acme_msgs/msg/Battery" not in REGISTERED
    kind = message_type(name)
    message = from_text(kind, "{charge: 0.5, name: left, cells: [{volts: 3.5}, {volts: 3.25}]}")
    assert decode(kind, encode(message)) == message
    assert to_json(message).endswith(b'"charge":0.5,"name":"left","cells":[{"volts":3.5},{"volts":3.25}]}')
    encoding = encoding_of(kind)
    REGISTERED.pop("acme_msgs/msg/Battery")
    sys.modules.pop("acme_messages")
    import_offered.cache_clear()
    found = type_of_encoding(encoding)
    assert found is not None
    assert found.ros_type == kind.ros_type


@pytest.mark.usefixtures("acme")
def test_a_broken_package_of_messages_is_told_once(caplog: pytest.LogCaptureFixture) -> None:
    """A tool that meets its types goes on without them, with one warning for each type."""
    with caplog.at_level("WARNING", "zteam"):
        assert type_of_encoding("application/cdr;broken_msgs/msg/X") is None
        assert type_of_encoding("application/cdr;broken_msgs/msg/X") is None
        assert type_of_encoding("application/cdr;unknown_msgs/msg/X") is None
    assert [record.getMessage().count("SystemExit: no licence") for record in caplog.records] == [1]


def test_own_names_read_no_metadata(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shipped behaviours, `module:Class` and zteam's own message types do without the packages' metadata."""

    def fail(**_: object) -> None:
        raise AssertionError("metadata was read")

    monkeypatch.setattr(importlib.metadata, "entry_points", fail)
    load_behavior("wander", {})
    load_behavior("zteam.robot.behaviors.wander:Avoid", {})
    kind = message_type("LaserScan")
    assert type_of_encoding(encoding_of(kind)) is kind
    with pytest.raises(AssertionError):
        load_offered("zteam.behaviors", "other")

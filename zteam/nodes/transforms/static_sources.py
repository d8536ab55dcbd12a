"""The processes behind fixed transforms: broadcasters, and callers that add one for as long as they live."""

from collections.abc import Callable, Iterable

from zteam import names
from zteam.bus.presence import holder_text
from zteam.bus.transport import RawSample
from zteam.clock import monotonic
from zteam.messages import Header, Quaternion, TFMessage, Transform, TransformStamped, Vector3
from zteam.runtime.process_node import ProcessNode
from zteam.runtime.tokens import GRACE, TokenLossFilter, TokenSet
from zteam.services.transforms import StaticReply, StaticRequest
from zteam.tf.merge import Merger

_SESSION = holder_text(None, "")


class StaticSources:
    """Takes what broadcasters say, serves `tf/static`, and drops a caller's frames when its token is gone for good.

    The authority of a broadcaster's frames is its session. All callbacks run under `node.changed`.
    """

    def __init__(self, node: ProcessNode, configured: Iterable[TransformStamped], publish: Callable[[], None]) -> None:
        """`publish()` publishes the fixed transforms if they changed. `listen` follows."""
        self._node = node
        self._publish = publish
        self._tokens = TokenSet()
        self._losses = TokenLossFilter()
        self.merger = Merger(configured, self.name_of)

    def listen(self, on_robot: Callable[[int], None]) -> None:
        """Take what comes; `on_robot(robot_id)` is called after fixed transforms of a robot have come."""
        node = self._node

        def take(sample: RawSample) -> None:
            target, message = names.split_robot_key(sample.key), node.bus.decode(sample, TFMessage)
            if target is not None and message is not None:
                with node.changed:
                    self.merger.take_static(target[0], message, _SESSION + sample.source, sample.timestamp)
                    self._publish()
                    on_robot(target[0])
                    node.changed.look()

        # Every sample: the newest one of each broadcaster counts, and not of each key alone.
        node.bus.subscribe_raw(names.all_robots_key(names.TF_STATIC), take, latched=True)
        node.bus.watch_link(self._on_link)
        node.watch_tokens(names.tokens_key(), self._on_token)
        node.bus.serve(names.service_key(names.AGGREGATOR, "static"), StaticRequest, self._add)

    def name_of(self, authority: str) -> str | None:
        """What users read for an authority; None for a session that holds no name: its process may have ended."""
        if not authority.startswith(_SESSION):
            return authority
        with self._node.changed:
            return self._tokens.name_of(authority.removeprefix(_SESSION))

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is not None and token[0] == names.STATIC_CALLER:
            self._losses.take_token(key, alive, monotonic())
        elif token is not None:
            self._tokens.take(*token, alive)
            self.merger.look_again(_SESSION + token[1])
            self._publish()

    def _on_link(self, up: bool) -> None:
        with self._node.changed:
            self._losses.take_link(up, monotonic())

    def drop_lost(self, grace: float = GRACE) -> None:
        """Drop the frames of callers that have had no token for `grace` host seconds (under `node.changed`)."""
        for key in self._losses.take_due(monotonic(), grace):
            token = names.split_token_key(key)
            if token is not None:
                self.merger.drop_authority(_caller(token[1]))
        self._publish()

    def _add(self, request: StaticRequest) -> StaticReply:
        rotation = Quaternion(request.qx, request.qy, request.qz, request.qw)
        transform = TransformStamped(
            Header(frame_id=names.strip_slash(request.parent)),
            names.strip_slash(request.child),
            Transform(Vector3(request.x, request.y, request.z), rotation),
        )
        with self._node.changed:
            # The request came over the router, so the link is up and missing tokens are gone: their frames are free.
            self.drop_lost(0.0)
            refused = self.merger.add_static(transform, _caller(request.caller))
            self._publish()
        return StaticReply(refused or "")


def _caller(caller: str) -> str:
    return f"{names.STATIC_CALLER} {caller}"

"""Fixed transforms that other processes add: each stays for as long as the process that asked for it."""

from collections.abc import Callable

from zteam import names
from zteam.clock import monotonic
from zteam.messages import Header, Quaternion, Transform, TransformStamped, Vector3
from zteam.runtime.node import Node
from zteam.runtime.token_loss import GRACE, TokenLossFilter
from zteam.services.transforms import StaticReply, StaticRequest
from zteam.tf.merge import Merger


class StaticCallers:
    """Serves `tf/static`, and drops a caller's frames when its token is gone for good."""

    def __init__(self, node: Node, merger: Merger, publish: Callable[[], None]) -> None:
        """`publish()` publishes the fixed transforms if they changed; it is called under `node.changed`."""
        self._node = node
        self._merger = merger
        self._publish = publish
        self._losses = TokenLossFilter()
        node.bus.watch_link(self._on_link)
        node.watch_tokens(names.tokens_key(names.STATIC_CALLER), self._on_token)
        node.bus.serve(names.service_key(names.AGGREGATOR, "static"), StaticRequest, self._add)

    def _on_token(self, key: str, alive: bool) -> None:
        self._losses.take_token(key, alive, monotonic())

    def _on_link(self, up: bool) -> None:
        with self._node.changed:
            self._losses.take_link(up, monotonic())

    def drop_lost(self, grace: float = GRACE) -> None:
        """Drop the frames of callers that have had no token for `grace` host seconds (under `node.changed`)."""
        for key in self._losses.take_due(monotonic(), grace):
            token = names.split_token_key(key)
            if token is not None:
                self._merger.drop_authority(_authority(token[1]))
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
            refused = self._merger.add_static(transform, _authority(request.caller))
            self._publish()
        return StaticReply(refused or "")


def _authority(caller: str) -> str:
    return f"{names.STATIC_CALLER} {caller}"

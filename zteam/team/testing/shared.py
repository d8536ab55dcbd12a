"""One team for many tests: each test finds it as `start` or `launch` left it, because it is started anew."""

import copy
import inspect
from collections.abc import Callable, Mapping
from typing import Any

from zteam.team.testing.team import TeamFixture


class SharedTeam(TeamFixture):
    """The `team_module` and `team_session` fixtures."""

    _call: tuple[Callable[..., None], Mapping[str, Any]] | None = None
    """What has started the team, `start` or `launch`, and its arguments."""
    _is_new = False
    """Whether this test may still start the team."""

    def start(self, *args: Any, **kwargs: Any) -> None:
        """As `Team.start`. A later test may start the same team again, which is there already, or another one."""
        self._begin(super().start, args, kwargs)

    def launch(self, *args: Any, **kwargs: Any) -> None:
        """As `Team.launch`, and in a later test as `start`."""
        self._begin(super().launch, args, kwargs)

    def _begin(self, begin: Callable[..., None], args: Any, kwargs: Any) -> None:
        """Start the team. In a later test that is done already, unless another team is asked for."""
        call = begin, copy.deepcopy(inspect.signature(begin).bind(*args, **kwargs).arguments)
        if self._is_new:
            self._is_new = False
            if call == self._call:
                return
            self._end()
        self._call = None
        begin(*args, **kwargs)
        self._call = call

    def _end(self) -> None:
        """End the team: as if nothing had been asked of the fixture yet."""
        self.close()
        TeamFixture.__init__(self, self._rootdir, live=self._live)

    def put_back(self) -> None:
        """Before a test: end the team of the test before, and start it again with the same arguments."""
        self._end()
        self._is_new = self._call is not None
        if self._call is not None:
            begin, arguments = self._call
            begin(**arguments)

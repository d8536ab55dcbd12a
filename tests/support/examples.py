"""How many examples the property tests draw."""

import os

from hypothesis import HealthCheck, settings

SHARE = float(os.environ.get("ZTEAM_EXAMPLES", "0.1"))
"""Times the examples that each test names; `.ci/full` sets 1. More than 1 is a search: new ones in each run."""


def examples(count: int) -> settings:
    """For a property test: `count` examples in `.ci/full`, and their share elsewhere.

    Speed is the machine's business, not a test's: a slow example is no failure.
    """
    return settings(
        max_examples=max(2, round(count * SHARE)),
        derandomize=SHARE <= 1.0,
        deadline=None,
        suppress_health_check=[HealthCheck.too_slow],
    )


settings.register_profile("any machine", examples(100))
settings.load_profile("any machine")

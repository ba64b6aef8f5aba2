"""What all tests share: how hypothesis draws its examples."""

from __future__ import annotations

from hypothesis import settings

# A busy machine takes its time; what is slow is seen in the durations, not in failures.
# The default suite tries the same examples everywhere, so that a change fails for its
# own reasons; `make test-slow` explores others each time.
settings.register_profile("reachmap", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None)
settings.load_profile("reachmap")

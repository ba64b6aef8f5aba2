"""What all tests share: helpers in tests/support can be imported, here and in workers.

Spawned workers get the search path of the process that started them.
"""

from __future__ import annotations

import sys
from pathlib import Path

from hypothesis import settings

SUPPORT = str(Path(__file__).resolve().parent / "support")

if SUPPORT not in sys.path:
    sys.path.insert(0, SUPPORT)

# A busy machine takes its time; what is slow is seen in the durations, not in failures.
# The default suite tries the same examples everywhere, so that a change fails for its
# own reasons; `make test-slow` explores others each time.
settings.register_profile("reachmap", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None)
settings.load_profile("reachmap")

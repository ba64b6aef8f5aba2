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
settings.register_profile("reachmap", deadline=None)
settings.load_profile("reachmap")

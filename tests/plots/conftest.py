"""Pictures in these tests are rendered coarsely: pixels are most of the time."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def _coarse_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("reachmap.plots.parts.style.DPI", 50)

"""Whether a map's inverse kinematics proves what it says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def ik_approximation(settings: Mapping[str, Any]) -> str:
    """How inverse kinematics is approximate, in words; "" where it is complete.

    Parameters
    ----------
    settings : mapping
        The settings in the artefact's provenance.

    Examples
    --------
    >>> ik_approximation({"ik_method": "analytic", "ik_complete": True})
    ''
    >>> ik_approximation({"ik_method": "numeric", "ik_complete": False})
    'numeric'
    """
    if settings.get("ik_complete", True):
        return ""
    return str(settings.get("ik_approximation") or settings.get("ik_method", ""))

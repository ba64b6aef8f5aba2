"""Paths of a roadmap as it found them, which a scan goes on to shorten."""

from __future__ import annotations

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.planning.connection import Connection
from reachmap.scans.ik_survey import Survey


def path_to_frame(
    survey: Survey, connection: Connection, frame: int
) -> FloatArray | None:
    """Path from the scan configuration to a frame over verified motions.

    Parameters
    ----------
    survey : Survey
    connection : Connection
        Of the same survey.
    frame : int

    Returns
    -------
    array, shape (n, dof), or None
        The shortest in the roadmap, not shortened further; None where the frame is
        not connected.
    """
    paths = connection.roadmap.shortest_paths()
    nodes = connection.roadmap.shortest_to_goals(paths)[survey.goals_of(frame)]
    lengths = paths.length_rad[nodes]
    if not len(nodes) or not np.isfinite(lengths).any():
        return None
    return paths.path_to(int(nodes[np.argmin(lengths)]))

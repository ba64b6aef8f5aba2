"""Grasp lists, the nearest test grasp, the cost J, the re-ordering.

A picking loop needs three names of this package::

    ranker = Ranker.from_map("bin.h5")                 # once
    ranking = ranker.rank(points, directions)          # for each image
    best = ranking.order[0]

and for lists as documents :func:`read_grasps`, :func:`rank_list` and
:func:`ranked_document`. Nothing here plans: no kinematics, collision or planning
engine is imported.
"""

from __future__ import annotations

from reachmap.geometry import rotation_between
from reachmap.ranking.answers.ranked_list import (
    RankedList,
    document_text,
    rank_list,
    ranked_document,
)
from reachmap.ranking.lists.arrays import GraspList
from reachmap.ranking.lists.reading import grasps_from_document, read_grasps
from reachmap.ranking.lookup.costs import OUTSIDE_MAP, Ranking, status_name
from reachmap.ranking.lookup.queries import align
from reachmap.ranking.lookup.ranker import Ranker
from reachmap.ranking.lookup.settings import CostBasis, RankSettings

__all__ = [
    "OUTSIDE_MAP",
    "CostBasis",
    "GraspList",
    "RankSettings",
    "RankedList",
    "Ranker",
    "Ranking",
    "align",
    "document_text",
    "grasps_from_document",
    "rank_list",
    "ranked_document",
    "read_grasps",
    "rotation_between",
    "status_name",
]

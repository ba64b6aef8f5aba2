"""Which test grasps stay reachable despite errors of bin, camera and tool."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.maps.display import Shown
from reachmap.maps.parts import freeze
from reachmap.maps.records import Provenance, RunInfo, Stamp


class Certificate(IntEnum):
    """What proves that a path stays free; the stored codes never change meaning."""

    NONE = 0
    STORED_CLEARANCE = 1
    DISPLACED_PAIRS = 2


CERTIFICATES = tuple(item.name.lower() for item in Certificate)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class Robustness(Shown):
    """Best paths of a bin map in perturbed cells.

    Index order (scale, sample) of the perturbed cells, (layer, y, x, orientation) of
    the test grasps of the bin map.

    Attributes
    ----------
    scale : array, shape (ns,)
        Multiples of the errors, from 0.
    layer, y, x : array
        As in the bin map [m].
    sizes : array, shape (3, 2)
        Shift [m] and turn [rad] of bin, camera and tool.
    margin_m : float
        Clearance that a path must keep in a perturbed cell.
    reached : uint8 array, shape (nl, ny, nx, no)
        1 where the bin map has a path.
    certificate : uint8 array, shape (ns, nl, ny, nx, no)
        :class:`Certificate` codes.
    kept : int array, shape (ns, nl, ny, nx, no)
        Perturbed cells in which the path stays free; all of them where that is proved.
    closest_pair : int array, shape (nl, ny, nx, no)
        Bodies that errors bring closest on the path, an index into ``body_pairs``; -1
        where none are known.
    bin_pose : array, shape (ns, nr, 4, 4)
        T_base_bin of each perturbed cell.
    tool_pose : array, shape (ns, nr, 4, 4)
        Its tool in the frame of the mount, the identity where it is not off.
    reachability : array, shape (ns, nr)
        Test grasps whose path stays free in each [percent].
    certified : array, shape (ns,)
        Test grasps that are proved to stay reachable [percent].
    body_pairs : tuple of str
    """

    scale: FloatArray
    layer: FloatArray
    y: FloatArray
    x: FloatArray
    sizes: FloatArray
    margin_m: float
    reached: CodeArray
    certificate: CodeArray
    kept: IntArray
    closest_pair: IntArray
    bin_pose: FloatArray
    tool_pose: FloatArray
    reachability: FloatArray
    certified: FloatArray
    body_pairs: tuple[str, ...]
    stamp: Stamp
    provenance: Provenance
    run: RunInfo

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def is_certified(self) -> BoolArray:
        """Test grasps that are proved to stay reachable, (ns, nl, ny, nx, no)."""
        return np.asarray(self.certificate != Certificate.NONE)

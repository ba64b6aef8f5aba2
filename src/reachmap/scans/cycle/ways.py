"""Ways of different lengths, one after another in one array."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from reachmap._typing import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)  # no slots: it keeps what it computes
class Ways:
    """Several ways through configurations.

    Attributes
    ----------
    point : array, shape (points, dof)
        [rad].
    size : int array, shape (ways,)
        Points of each.
    """

    point: FloatArray
    size: IntArray

    @classmethod
    def of(cls, ways: Sequence[FloatArray], dof: int) -> Ways:
        """Put ways of shape (n, dof) one after another."""
        return cls(
            point=np.vstack([np.zeros((0, dof)), *ways]),
            size=np.array([len(way) for way in ways], np.int64),
        )

    @classmethod
    def join(cls, parts: Sequence[Mapping[str, Any]], dof: int) -> Ways:
        """Put payloads of ways one after another."""
        return cls(
            point=np.vstack([np.zeros((0, dof)), *(part["point"] for part in parts)]),
            size=np.concatenate(
                [np.zeros(0, np.int64), *(part["size"] for part in parts)]
            ).astype(np.int64),
        )

    @cached_property
    def _begin(self) -> IntArray:
        return np.asarray(np.cumsum(self.size) - self.size)

    def __len__(self) -> int:
        return len(self.size)

    def __getitem__(self, row: int) -> FloatArray:
        begin = int(self._begin[row])
        return self.point[begin : begin + int(self.size[row])]

    def take(self, rows: Sequence[int] | IntArray) -> Ways:
        """Some of the ways."""
        return Ways.of([self[int(row)] for row in rows], self.point.shape[1])

    @property
    def first(self) -> FloatArray:
        """First point of each, shape (ways, dof); none may be empty."""
        return np.asarray(self.point[self._begin])

    @property
    def last(self) -> FloatArray:
        """Last point of each, shape (ways, dof); none may be empty."""
        return np.asarray(self.point[self._begin + self.size - 1])

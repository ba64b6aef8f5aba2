"""The volume that test grasps represent: points in the bin and directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspVolume:
    """A box of points and a band of tilts, in the bin frame.

    Attributes
    ----------
    low, high : array, shape (3,)
        Corners of the box [m].
    cosines : (float, float)
        Cosines of the greatest and of the least tilt from straight down.
    """

    low: FloatArray
    high: FloatArray
    cosines: tuple[float, float]

    @classmethod
    def of(
        cls, points: FloatArray, layers_m: FloatArray, pitch_m: float, axes: FloatArray
    ) -> GraspVolume:
        """Volume of a grid of test grasps.

        It ends at the outermost points sideways, and half a step below the lowest and
        above the highest layer; with a single layer, half a pitch either way.

        Parameters
        ----------
        points : array, shape (n, 3)
            In the bin frame [m].
        layers_m : array, shape (nl,)
            Heights [m].
        pitch_m : float
            Larger spacing of the grid [m].
        axes : array, shape (n, 3)
            Approach directions in the bin frame.
        """
        low, high = points.min(axis=0), points.max(axis=0)
        step = float(np.diff(layers_m).max()) if len(layers_m) > 1 else pitch_m
        low[2] = max(float(layers_m[0]) - step / 2, 0.0)
        high[2] = float(layers_m[-1]) + step / 2
        down = -axes[:, 2]
        return cls(low=low, high=high, cosines=(float(down.min()), float(down.max())))

    def draw(
        self, rng: np.random.Generator, count: int
    ) -> tuple[FloatArray, FloatArray]:
        """Points, uniform in the box, and directions, uniform over the sphere.

        Returns
        -------
        points, directions : array, shape (count, 3)
            In the bin frame.
        """
        points = rng.uniform(self.low, self.high, (count, 3))
        shares = rng.random((count, 2))
        low, high = self.cosines
        cosine = np.clip(high - shares[:, 0] * (high - low), -1.0, 1.0)
        sine, azimuth = np.sqrt(1.0 - cosine**2), 2.0 * np.pi * shares[:, 1]
        return points, np.stack(
            [sine * np.cos(azimuth), sine * np.sin(azimuth), -cosine], axis=1
        )

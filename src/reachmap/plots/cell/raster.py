"""Pictures of solids without a graphics engine: a depth buffer in NumPy.

Parallel projection, so that a picture has a scale; light from above the viewer's left
shoulder; ink where bodies end or bend. The same solids give the same bytes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.geometry import transform_points

# A choice: samples of a pixel along each side, against jagged edges.
SAMPLES = 2
# Sides of the tiles in which small facets are drawn many at a time [pixels].
TILES = (6, 16, 40)
# A choice that bounds the memory.
CHUNK_PIXELS = 400_000
# Faces that meet at a smaller angle are shaded as one round surface.
CREASE_COS = float(np.cos(np.radians(38.0)))
# Choices by eye: where edges are drawn, how dark they are, and where light comes from.
DEPTH_JUMP_M = 0.012
BEND_COS = 0.72
INK = 0.16
LIGHT = np.array([-0.42, 0.55, 0.72])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Facets:
    """Triangles in one frame, each with its colour and its owner.

    Attributes
    ----------
    corners : array, shape (n, 3, 3)
        Corners of each triangle [m].
    normals : array, shape (n, 3, 3)
        Unit normals at the corners.
    colour : array, shape (n, 3)
        sRGB from 0 to 1.
    owner : int array, shape (n,)
        Number of the solid.
    """

    corners: FloatArray
    normals: FloatArray
    colour: FloatArray
    owner: IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """What a picture shows: a direction, and a rectangle across it.

    Attributes
    ----------
    axes : array, shape (3, 3)
        Unit vectors to the right, up, and towards the viewer, as rows.
    low, high : array, shape (2,)
        Lower left and upper right corner along the first two [m].
    """

    axes: FloatArray
    low: FloatArray
    high: FloatArray


def view_axes(azimuth_deg: float, elevation_deg: float) -> FloatArray:
    """Axes of a picture seen from a direction, rows right, up, towards the viewer.

    At azimuth 0 the viewer stands on the +x side; at elevation 90 they look down with
    x to the right for azimuth -90.
    """
    a, e = np.radians([azimuth_deg, elevation_deg])
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return np.stack([right, np.cross(towards, right), towards])


def facets_of(
    vertices: FloatArray,
    triangles: IntArray,
    T: FloatArray,
    rgb: FloatArray,
    owner: int,
) -> Facets:
    """Triangles of one solid, placed, with normals that are smooth up to creases.

    Parameters
    ----------
    vertices : array, shape (n, 3)
    triangles : int array, shape (m, 3)
    T : array, shape (4, 4)
        Pose of the solid.
    rgb : array, shape (3,)
        From 0 to 1.
    owner : int
    """
    placed = transform_points(T, vertices)
    corners = placed[triangles]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(area, axis=1)
    real = size > 1e-14
    corners, area, size = corners[real], area[real], size[real]
    normals = _corner_normals(triangles[real], area, size, len(vertices))
    count = len(corners)
    return Facets(
        corners=corners,
        normals=normals,
        colour=np.tile(np.asarray(rgb, float), (count, 1)),
        owner=np.full(count, owner, np.int64),
    )


def _corner_normals(
    triangles: IntArray, area: FloatArray, size: FloatArray, vertices: int
) -> FloatArray:
    """Mean of the normals around each corner that do not lie beyond a crease."""
    flat = area / size[:, None]
    corners = triangles.size
    meets = csr_array(
        (np.ones(corners), (np.arange(corners), triangles.ravel())),
        shape=(corners, vertices),
    )
    # Corners at the same vertex, as pairs; each belongs to the face corner // 3.
    here, there = (meets @ meets.T).nonzero()
    same = (flat[here // 3] * flat[there // 3]).sum(axis=1) > CREASE_COS
    total = np.zeros((corners, 3))
    np.add.at(total, here[same], area[there[same] // 3])
    total /= np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)
    return total.reshape(-1, 3, 3)


def join(parts: Sequence[Facets]) -> Facets:
    """All facets of several solids."""
    return Facets(
        corners=np.concatenate([part.corners for part in parts]),
        normals=np.concatenate([part.normals for part in parts]),
        colour=np.concatenate([part.colour for part in parts]),
        owner=np.concatenate([part.owner for part in parts]),
    )


def render(facets: Facets, window: Window, pixels_per_m: float) -> FloatArray:
    """Draw facets.

    Returns
    -------
    array, shape (rows, columns, 4)
        sRGB and coverage from 0 to 1, the top row first.
    """
    which, depth, pixel = _depth_buffer(facets, window, pixels_per_m * SAMPLES)
    normal = _normals(facets, which, pixel)
    seen = which >= 0
    owner = np.where(seen, facets.owner[np.maximum(which, 0)], -1)
    light = window.axes.T @ (LIGHT / np.linalg.norm(LIGHT))
    # Both sides of a face are lit: not every mesh has its normals outside.
    facing = normal @ window.axes[2]
    normal = np.where(facing[..., None] < 0.0, -normal, normal)
    shade = 0.46 + 0.42 * np.clip(normal @ light, 0.0, 1.0)
    shade += 0.16 * np.abs(facing)
    colour = facets.colour[np.maximum(which, 0)] * np.minimum(shade, 1.06)[..., None]
    ink = _ink(owner, normal, depth)
    image = np.zeros((*which.shape, 4))
    image[..., :3] = np.clip(colour, 0.0, 1.0)
    image[ink, :3] = INK
    image[..., 3] = seen | ink
    image[~(seen | ink), :3] = 1.0
    return _reduced(image)


def visible_area(facets: Facets, window: Window, pixels_per_m: float) -> IntArray:
    """Count the pixels in which each owner is seen, shape (owners,)."""
    which, _, _ = _depth_buffer(facets, window, pixels_per_m)
    owner = facets.owner[which[which >= 0]]
    return np.bincount(owner, minlength=int(facets.owner.max(initial=-1)) + 1)


@dataclass(slots=True)
class _Buffer:
    """Nearest facet of each pixel, -1 for none, and its depth; the top row first."""

    which: IntArray
    depth: FloatArray

    def put(self, pixel: IntArray, depth: FloatArray, facet: IntArray) -> None:
        """Enter samples by flat pixel number where they are nearer than before."""
        nearer = depth > self.depth.ravel()[pixel]
        pixel, depth, facet = pixel[nearer], depth[nearer], facet[nearer]
        # Of an index that is repeated NumPy keeps the last: the nearest.
        order = np.lexsort((facet, depth))
        self.depth.reshape(-1)[pixel[order]] = depth[order]
        self.which.reshape(-1)[pixel[order]] = facet[order]


def _depth_buffer(
    facets: Facets, window: Window, scale: float
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Nearest facet (-1 for none) and depth of each pixel; corners in pixels."""
    sides = window.high - window.low
    columns, rows = (SAMPLES * max(1, round(float(s) * scale / SAMPLES)) for s in sides)
    shape = (rows, columns)
    buffer = _Buffer(np.full(shape, -1, np.int64), np.full(shape, -np.inf))
    place = facets.corners @ window.axes.T
    pixel = (place[..., :2] - window.low) * scale
    pixel[..., 1] = rows - pixel[..., 1]
    low = np.maximum(np.floor(pixel.min(axis=1)).astype(np.int64), 0)
    high = np.minimum(np.ceil(pixel.max(axis=1)).astype(np.int64), [columns, rows])
    size = (high - low).max(axis=1)
    waiting = ((high - low) > 0).all(axis=1)
    for side in TILES:
        rest = np.flatnonzero(waiting & (size <= side))
        waiting[rest] = False
        chunk = max(1, CHUNK_PIXELS // side**2)
        for start in range(0, len(rest), chunk):
            some = rest[start : start + chunk]
            _fill(buffer, some, low[some], side, pixel[some], place[some, :, 2])
    for one in np.flatnonzero(waiting)[:, None]:
        _fill(buffer, one, low[one], high[one[0]] - low[one[0]], pixel[one],
              place[one, :, 2])  # fmt: skip
    return buffer.which, buffer.depth, pixel


def _fill(
    buffer: _Buffer,
    facet: IntArray,
    low: IntArray,
    side: int | IntArray,
    pixel: FloatArray,
    depth: FloatArray,
) -> None:
    """Enter some facets whose tiles begin at ``low`` and have the same sides."""
    rows, columns = buffer.which.shape
    width, height = np.broadcast_to(side, (2,))
    x = low[:, 0, None, None] + np.arange(width)[None, None, :]
    y = low[:, 1, None, None] + np.arange(height)[None, :, None]
    weights = _weights(pixel[:, :, :, None, None], x + 0.5, y + 0.5)
    covered = (weights[0] >= -1e-9) & (weights[1] >= -1e-9) & (weights[2] >= -1e-9)
    covered &= (x < columns) & (y < rows)
    z = sum(w * depth[:, k, None, None] for k, w in enumerate(weights))
    number = np.broadcast_to(y * columns + x, covered.shape)[covered]
    which = np.broadcast_to(facet[:, None, None], covered.shape)[covered]
    buffer.put(number, np.asarray(z)[covered], which)


def _weights(
    corner: FloatArray, x: Any, y: Any
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Barycentric weights of points; outside everything for a facet seen edge-on.

    ``corner`` has the shape (n, 3, 2, ...) and broadcasts against ``x`` and ``y``.
    """
    ax, bx, cx = (corner[:, k, 0] for k in range(3))
    ay, by, cy = (corner[:, k, 1] for k in range(3))
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    area = np.where(np.abs(area) < 1e-9, np.nan, area)
    u = ((bx - x) * (cy - y) - (by - y) * (cx - x)) / area
    v = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / area
    return u, v, 1.0 - u - v


def _normals(facets: Facets, which: IntArray, pixel: FloatArray) -> FloatArray:
    """Unit normal of each pixel, between those of the corners; 0 where nothing is."""
    normal = np.zeros((*which.shape, 3))
    y, x = np.nonzero(which >= 0)
    facet = which[y, x]
    u, v, w = _weights(pixel[facet], x + 0.5, y + 0.5)
    corner = facets.normals[facet]
    mean = u[:, None] * corner[:, 0] + v[:, None] * corner[:, 1]
    mean += w[:, None] * corner[:, 2]
    length = np.linalg.norm(mean, axis=-1, keepdims=True)
    normal[y, x] = mean / np.maximum(length, 1e-12)
    return normal


def _ink(owner: IntArray, normal: FloatArray, depth: FloatArray) -> BoolArray:
    """Pixels on an edge: another solid beside them, a step in depth, or a bend."""
    ink = np.zeros(owner.shape, bool)
    for axis in (0, 1):
        first: list[slice] = [slice(None), slice(None)]
        second = first.copy()
        first[axis], second[axis] = slice(None, -1), slice(1, None)
        a, b = tuple(first), tuple(second)
        both = (owner[a] >= 0) & (owner[b] >= 0)
        with np.errstate(invalid="ignore"):
            step = np.abs(depth[a] - depth[b]) > DEPTH_JUMP_M
        bend = (normal[a] * normal[b]).sum(axis=-1) < BEND_COS
        edge = (owner[a] != owner[b]) | (both & (bend | step))
        ink[a] |= edge
    return ink


def _reduced(image: FloatArray) -> FloatArray:
    """Mean of each block of samples, shape (rows, columns, 4)."""
    rows, columns = image.shape[0] // SAMPLES, image.shape[1] // SAMPLES
    blocks = image.reshape(rows, SAMPLES, columns, SAMPLES, 4)
    weight = blocks[..., 3:]
    total = weight.sum(axis=(1, 3))
    colour = (blocks[..., :3] * weight).sum(axis=(1, 3)) / np.maximum(total, 1e-12)
    return np.concatenate([colour, total / SAMPLES**2], axis=-1)

"""How far a point of the robot can move when the joints move.

A change Δq moves no point of body g further than ``Σ_j R[g, j] |Δq_j|``, where
``R[g, j]`` bounds the distance of the body's points from the axis of joint j over all
configurations (for a prismatic joint it is 1). The bound follows the chain outwards
in: a point within ρ of the origin of joint j+1 is within ``‖p‖ + ρ`` of the origin of
joint j; where the two axes are parallel, only distances across the axes add up.
"""

from __future__ import annotations

from typing import Any

import coal
import numpy as np

from reachmap._typing import FloatArray


def displacement_bounds(model: Any, geometry: Any) -> FloatArray:
    """Bounds R of all bodies and joints, shape (bodies, dof), [m/rad] or [m/m].

    Parameters
    ----------
    model : pinocchio.Model
        A chain: the parent of joint j is joint j − 1.
    geometry : pinocchio.GeometryModel
    """
    axes = [_axis(model, joint) for joint in range(1, model.njoints)]
    bounds = np.zeros((geometry.ngeoms, model.nv))
    for row, body in zip(bounds, geometry.geometryObjects, strict=True):
        if body.parentJoint == 0:
            continue
        points = _corner_points(body.geometry)
        points = points @ body.placement.rotation.T + body.placement.translation
        _fill_row(row, model, axes, body.parentJoint, points)
    return bounds


def _fill_row(
    row: FloatArray,
    model: Any,
    axes: list[tuple[FloatArray, bool]],
    joint: int,
    points: FloatArray,
) -> None:
    """Walk from the body's own joint to the root, outermost bound first."""
    axis, turns = axes[joint - 1]
    across = float(_across(points, axis).max())
    around = float(np.linalg.norm(points, axis=1).max())
    row[joint - 1] = across if turns else 1.0
    while (parent := model.parents[joint]) > 0:
        offset = model.jointPlacements[joint]
        axis, turns = axes[joint - 1]
        travel = 0.0 if turns else _largest_travel(model, joint)
        parent_axis, parent_turns = axes[parent - 1]
        here = offset.rotation @ axis
        parallel = turns and np.linalg.norm(np.cross(here, parent_axis)) < 1e-9
        step = float(_across(offset.translation[None], parent_axis)[0])
        around = float(np.linalg.norm(offset.translation)) + travel + around
        across = min(around, step + across) if parallel else around
        row[parent - 1] = across if parent_turns else 1.0
        joint = parent


def _axis(model: Any, joint: int) -> tuple[FloatArray, bool]:
    """Unit axis in the joint frame, and whether the joint turns about it."""
    data = model.joints[joint].createData()
    model.joints[joint].calc(data, np.zeros(model.nq))
    motion = np.asarray(data.S).reshape(6, -1)[:, 0]
    turns = bool(np.linalg.norm(motion[3:]) > 0.5)
    return (motion[3:] if turns else motion[:3]), turns


def _across(points: FloatArray, axis: FloatArray) -> FloatArray:
    """Distance of points from the line through the origin along a unit axis."""
    along = points @ axis
    return np.asarray(np.linalg.norm(points - np.outer(along, axis), axis=1))


def _largest_travel(model: Any, joint: int) -> float:
    index = model.idx_qs[joint]
    low, high = model.lowerPositionLimit[index], model.upperPositionLimit[index]
    return float(max(abs(low), abs(high)))


def _corner_points(shape: Any) -> FloatArray:
    """Points whose convex hull holds the shape, shape (n, 3)."""
    if isinstance(shape, coal.BVHModelBase):
        return np.asarray(shape.vertices(), float).reshape(-1, 3)
    if isinstance(shape, coal.Box):
        half = np.asarray(shape.halfSide, float)
    elif isinstance(shape, coal.Sphere):
        half = np.full(3, float(shape.radius))
    elif isinstance(shape, coal.Capsule):
        half = np.array([shape.radius, shape.radius, shape.halfLength + shape.radius])
    elif isinstance(shape, coal.Cylinder):
        half = np.array([shape.radius, shape.radius, shape.halfLength])
    else:
        box = shape.aabb_local
        shape.computeLocalAABB()
        low, high = np.asarray(box.min_), np.asarray(box.max_)
        centre, half = (low + high) / 2, (high - low) / 2
        return centre + _SIGNS * half
    return _SIGNS * half


_SIGNS = np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0])).reshape(3, -1).T

"""The choice of a solver for an arm: the first, by rank, that takes it."""

from __future__ import annotations

import pkgutil
from functools import cache, lru_cache
from importlib import import_module

import numpy as np

from reachmap.cell.model.cell import IkSpec
from reachmap.core.kinematics import solvers
from reachmap.core.kinematics.solvers.arm import FULL_AXES, Arm, BranchSolver, Way
from reachmap.errors import SceneError


def choose_solver(arm: Arm) -> BranchSolver:
    """Solver of an arm; made once for each arm and process.

    Raises
    ------
    SceneError
        No way that the arm's spec allows takes it.
    """
    return _chosen(_Key(arm))


class _Key:
    """An arm, equal to arms of the same numbers."""

    def __init__(self, arm: Arm) -> None:
        self.arm, chain = arm, arm.chain
        arrays = (chain.T_fixed, chain.axes_base, arm.lower, arm.upper)
        numbers = b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)
        kinds = chain.is_revolute.tobytes()
        spec_json = arm.spec.model_dump_json()
        self._identity = (numbers, kinds, arm.joint_names, spec_json)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and self._identity == other._identity

    def __hash__(self) -> int:
        return hash(self._identity)


@lru_cache(maxsize=16)
def _chosen(key: _Key) -> BranchSolver:
    arm = key.arm
    _check_redundant_joint(arm)
    allowed = [way for way in _ways() if _is_allowed(way, arm.spec)]
    offers = (way.offer(arm) for way in allowed)
    solver = next((offer for offer in offers if offer is not None), None)
    if solver is None:
        raise SceneError(
            "robot.ik.method: this arm has no closed form that is known to EAIK; "
            "use auto or numeric"
        )
    return solver


def _is_allowed(way: Way, spec: IkSpec) -> bool:
    return {
        "auto": True,
        "analytic": way.is_closed_form,
        "numeric": not way.is_closed_form,
    }[spec.method]


@cache
def _ways() -> tuple[Way, ...]:
    """All ways, found by the modules beside this one."""
    found = []
    for module in pkgutil.iter_modules(solvers.__path__, f"{solvers.__name__}."):
        way = getattr(import_module(module.name), "WAY", None)
        if isinstance(way, Way):
            found.append(way)
    return tuple(sorted(found, key=lambda way: way.rank))


def _check_redundant_joint(arm: Arm) -> None:
    name = arm.spec.redundant_joint
    if name is None:
        return
    if name not in arm.joint_names:
        raise SceneError(
            f"robot.ik.redundant_joint: no joint {name!r} moves "
            f"(joints: {', '.join(arm.joint_names)})"
        )
    if arm.chain.dof <= FULL_AXES:
        raise SceneError(
            "robot.ik.redundant_joint: only arms of seven joints or more have one, "
            f"this one has {arm.chain.dof}"
        )

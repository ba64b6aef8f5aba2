"""An arm, what solves its kinematics, and the choice: the first, by rank, that can."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from importlib import import_module
from typing import Protocol

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.model.cell import IkSpec
from reachmap.core.kinematics import solvers
from reachmap.core.kinematics.closed_form import ACCEPTED
from reachmap.core.kinematics.nominal import rounding
from reachmap.core.kinematics.solutions import Rows
from reachmap.core.robot.chain import SerialChain
from reachmap.errors import SceneError

# Arms of fewer axes cannot correct what rounded angles put beside a pose.
FULL_AXES = 6


@dataclass(frozen=True, kw_only=True, eq=False)
class Arm:
    """An arm to be solved.

    Attributes
    ----------
    chain : SerialChain
    lower, upper : array, shape (dof,)
        Joint limits [rad or m].
    joint_names : tuple of str
    spec : IkSpec
    """

    chain: SerialChain
    lower: FloatArray
    upper: FloatArray
    joint_names: tuple[str, ...]
    spec: IkSpec

    @cached_property
    def tolerance(self) -> float:
        """Largest miss of a solution [m and rad].

        1e-7, or what rounded angles of the URDF explain where the arm has fewer than
        six axes: it could not meet a vertical tool if that is 7e-6 rad off.
        """
        if self.chain.dof >= FULL_AXES:
            return ACCEPTED
        return max(ACCEPTED, rounding(self.chain))

    @property
    def rounding_note(self) -> str:
        """Words on poses that are missed as angles are rounded; "" if they are not."""
        if self.tolerance <= ACCEPTED:
            return ""
        return (
            f"; a pose may be missed by {self.tolerance:.0e} m and rad, as angles of "
            "the URDF are rounded"
        )


class BranchSolver(Protocol):
    """A way to solve inverse kinematics, made for one arm."""

    @property
    def method(self) -> str:
        """Name that is stored with maps."""
        ...

    @property
    def complete(self) -> bool:
        """Whether a pose without solutions is proved to have none."""
        ...

    @property
    def approximation(self) -> str:
        """How solutions are sought where that proves nothing; "" if complete."""
        ...

    @property
    def tolerance(self) -> float:
        """Largest miss of a solution [m and rad]."""
        ...

    def branches(self, T: FloatArray) -> Rows:
        """Solutions of poses (n, 4, 4), without whole turns."""
        ...


@dataclass(frozen=True, kw_only=True)
class Way:
    """A solver as the choice of solvers sees it.

    Attributes
    ----------
    rank : int
        Ways of lower rank are asked first.
    is_closed_form : bool
    offer : callable
        The solver for an arm, None if the arm is not of its kind.
    """

    rank: int
    is_closed_form: bool
    offer: Callable[[Arm], BranchSolver | None]


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

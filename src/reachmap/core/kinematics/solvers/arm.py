"""What a way of solving inverse kinematics is given, and what it has to offer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

from reachmap._typing import FloatArray
from reachmap.cell.model.cell import IkSpec
from reachmap.core.kinematics.closed_form import ACCEPTED
from reachmap.core.kinematics.nominal import rounding
from reachmap.core.kinematics.solutions import Rows
from reachmap.core.robot.chain import SerialChain

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

"""Whether a configuration is free; if not, which two bodies touch.

The truth is coal on the collision meshes with a safety margin on every pair. Beside it
stands a ladder of checks with wider and wider margins, on convex hulls: a configuration
that is clear by a distance lets the robot move by that much without another check,
which is how :mod:`reachmap.core.planning.motion` proves whole motions free.

An answer depends on the question alone, to the last bit, and never on what was asked
before; so units of work may be done in any order and process.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

import coal
import numpy as np
import pinocchio as pin

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.core.collision.bodies import BodyGeometry, disable_cached_guesses
from reachmap.core.collision.displacement import MotionBound
from reachmap.core.collision.never_collide import PairMotion, pairs_that_never_collide
from reachmap.core.collision.pair_checker import PairChecker
from reachmap.core.collision.shapes import convex_hull
from reachmap.core.robot.chain import SerialChain
from reachmap.core.trace import EVERY, FREE, TOUCHING, Trace

if TYPE_CHECKING:
    from reachmap.core.robot.model import RobotModel

# Doubled from half the usual resolution on: what is clear by more than the last rung
# is rare in a bin, and each rung costs a set of pairs to keep.
LADDER_M = (0.004, 0.008, 0.016, 0.032, 0.064)
WIDEST_M = LADDER_M[-1]
_NO_PAIR = -1


class CollisionChecker:
    """Collision checks of configurations.

    Parameters
    ----------
    robot : RobotModel
    bodies : BodyGeometry
        Pairs that can never collide are removed from it.
    safety_margin_m : float
        Bodies closer than this count as touching.
    movable : collection of str
        Bodies that stand still and may be moved; nothing is proved about them.

    Attributes
    ----------
    robot : RobotModel
    body_pairs : tuple of str
        ``"A | B"`` for each different pair of names that is checked.
    proved_pairs : tuple of str
        Pairs that were proved never to meet.
    reach_m : array, shape (dof,)
        No point of the robot moves further than ``reach_m @ |Δq|`` [m/rad].
    pair_reach_m : array, shape (pairs, dof)
        The bodies of a pair move by no more than ``pair_reach_m @ |Δq|`` against each
        other [m/rad]. Pairs are those of the geometry, several of which may have one
        name.
    pair_index : int array, shape (pairs,)
        Each pair's name, an index into ``body_pairs``.
    bodies, hulls : pinocchio.GeometryModel
        What is checked, and the same with convex hulls in place of meshes.
    bound : MotionBound
        The tighter bound of a motion from where the robot is.
    checks : int
        Configurations checked so far, the unit in which budgets are counted.
    """

    def __init__(
        self,
        robot: RobotModel,
        bodies: BodyGeometry,
        safety_margin_m: float,
        *,
        movable: Collection[str] = (),
    ) -> None:
        self.robot = robot
        self._model = robot.body_model
        self.bodies = bodies.geometry
        self._movable = {n: k for k, n in enumerate(bodies.names) if n in movable}
        self.safety_margin_m = safety_margin_m
        motion = PairMotion(robot, bodies)
        self.hulls = _with_convex_hulls(bodies.geometry)
        proved = pairs_that_never_collide(
            robot,
            self.hulls,
            motion,
            safety_margin_m,
            left_out=frozenset(self._movable.values()),
        )
        for first, second in proved:
            pair = pin.CollisionPair(first, second)
            bodies.geometry.removeCollisionPair(pair)
            self.hulls.removeCollisionPair(pair)
        self.proved_pairs = tuple(
            f"{bodies.names[a]} | {bodies.names[b]}" for a, b in proved
        )
        self._pair_names = bodies.pair_names()
        self.body_pairs = tuple(dict.fromkeys(self._pair_names))
        self.pair_index = np.array(
            [self.body_pairs.index(name) for name in self._pair_names], dtype=np.int64
        )
        self.reach_m = np.maximum(motion.bounds.max(axis=0, initial=0.0), 1e-9)
        self.bound = MotionBound(
            SerialChain.from_robot(robot), robot, bodies, motion.bounds, self.reach_m
        )
        self.pair_reach_m = np.array(
            [motion.between(pair)[1] for pair in bodies.geometry.collisionPairs]
        ).reshape(-1, robot.dof)
        # A motion that moves no point further than d moves the bodies of a pair by at
        # most this share of d relative to each other: two neighbours at the wrist need
        # not keep the distance that the camera needs from the floor.
        self._shares = (self.pair_reach_m / self.reach_m).max(axis=1, initial=0.0)
        self.checks = 0
        self._pair_checkers: dict[tuple[int, str, int], PairChecker] = {}
        self._start_engine()

    def _start_engine(self) -> None:
        self._data = self._model.createData()
        # Made when first asked: bodies are moved more often than all rungs are used.
        self._engines: dict[int, tuple[Any, Any]] = {}

    def _engine(self, about: int) -> tuple[Any, Any]:
        """Broadphase and results, of FREE or a rung of the ladder."""
        if about not in self._engines:
            geometry = self.bodies if about == FREE else self.hulls
            margins_m = self._pair_margins_m(about)
            self._engines[about] = self._broadphase_with(geometry, margins_m)
        return self._engines[about]

    def _pair_margins_m(self, about: int) -> FloatArray:
        if about == FREE:
            return np.full(len(self._pair_names), self.safety_margin_m)
        return np.asarray(self.safety_margin_m + LADDER_M[about] * self._shares)

    def move(
        self,
        T_root_body: Mapping[str, FloatArray],
        shapes: Mapping[str, Any] | None = None,
    ) -> None:
        """Move movable bodies, by name and pose (4, 4).

        Primitives may have another size there: ``shapes`` are those of coal, by name.
        """
        for name, T in T_root_body.items():
            placement = pin.SE3(np.ascontiguousarray(T))
            for geometry in (self.bodies, self.hulls):
                body = geometry.geometryObjects[self._movable[name]]
                body.placement = placement
                if shapes and name in shapes:
                    body.geometry = shapes[name]
        for key in [key for key in self._pair_checkers if key[1] in T_root_body]:
            del self._pair_checkers[key]
        self._start_engine()

    def _broadphase_with(self, geometry: Any, margins: FloatArray) -> tuple[Any, Any]:
        data = geometry.createData()
        for request, margin in zip(data.collisionRequests, margins, strict=True):
            request.security_margin = float(margin)
        disable_cached_guesses(data.collisionRequests)
        # The naive manager is the fastest on a cell; the sweep-and-prune one misses
        # collisions (reference: 75 of 10,500).
        manager = pin.BroadPhaseManager_NaiveCollisionManager(
            self._model, geometry, data
        )
        return manager, data

    def is_free(self, q: FloatArray) -> bool:
        """Whether all pairs are further apart than the safety margin."""
        self.checks += 1
        free = not pin.computeCollisions(
            self._model,
            self._data,
            self._engine(FREE)[0],
            self.robot.body_configuration(q),
            True,
        )
        if Trace.current is not None:
            Trace.current.note(self, FREE, q, free)
        return free

    def is_clear(self, q: FloatArray, distance_m: float) -> bool:
        """Whether the robot may move by a distance from q, whichever way.

        True is a proof: no motion in which no point moves further than ``distance_m``
        brings a pair closer than the safety margin. False says nothing; the answer is
        conservative, as it uses convex hulls and the next wider step of the ladder.
        """
        for rung, step in enumerate(LADDER_M):
            if step >= distance_m:
                return self._is_clear_at(rung, q)
        return False

    def _is_clear_at(self, rung: int, q: FloatArray) -> bool:
        self.checks += 1
        clear = not pin.computeCollisions(
            self._model,
            self._data,
            self._engine(rung)[0],
            self.robot.body_configuration(q),
            True,
        )
        if Trace.current is not None:
            Trace.current.note(self, rung, q, clear)
        return clear

    def asked(self, about: int, q: FloatArray) -> Any:
        """Answer what a trace has noted: FREE, TOUCHING or a rung of the ladder."""
        if about == TOUCHING:
            return self.touching_pairs(q)
        return self.is_free(q) if about == FREE else self._is_clear_at(about, q)

    def touched_mask(
        self, about: int, Q: FloatArray, name: str, body: int
    ) -> BoolArray:
        """Whether a body that stands still touches a moving one, (n, dof) to (n,).

        Parameters
        ----------
        about : int
            FREE or a rung of the ladder.
        Q : array, shape (n, dof)
        name : str
            Of the body that stands still.
        body : int
            The moving one, as :meth:`bodies_against` counts; EVERY for all of them.
        """
        key = about, name, body
        if key not in self._pair_checkers:
            pairs = self._pairs_of(name, body)
            self._pair_checkers[key] = PairChecker(
                self._model,
                self.bodies if about == FREE else self.hulls,
                pairs,
                self._pair_margins_m(about)[pairs],
            )
        robot = self.robot
        if len(robot.following):
            Q = np.array([robot.body_configuration(q) for q in Q])
        return self._pair_checkers[key].touched(Q)

    def _pairs_of(self, name: str, body: int = EVERY) -> IntArray:
        moving = None if body == EVERY else int(self.bound.on_chain[body])
        found = [
            k
            for k, (pair, names) in enumerate(
                zip(self.bodies.collisionPairs, self._pair_names, strict=True)
            )
            if name in names.split(" | ")
            and (moving is None or moving in (pair.first, pair.second))
        ]
        return np.array(found, np.int64)

    def margins_m(self, about: IntArray) -> FloatArray:
        """How near a body has to be to one that stands still to matter.

        Parameters
        ----------
        about : int array, shape (n,)
            What was asked.

        Returns
        -------
        array, shape (n, bodies)
            For the bodies that the chain moves [m].
        """
        share = np.zeros(len(self.bodies.geometryObjects))
        for pair, value in zip(self.bodies.collisionPairs, self._shares, strict=True):
            for body in (pair.first, pair.second):
                share[body] = max(share[body], value)
        steps = np.array([*LADDER_M, 0.0])[np.maximum(about, FREE)]
        moving = share[self.bound.on_chain]
        return np.asarray(self.safety_margin_m + steps[:, None] * moving)

    def bodies_against(self, name: str) -> tuple[int, ...] | None:
        """Which bodies are checked against one that stands still.

        Counted among those that the chain moves; None where there are others.
        """
        number = {int(body): k for k, body in enumerate(self.bound.on_chain)}
        pairs = [self.bodies.collisionPairs[int(k)] for k in self._pairs_of(name)]
        found = {number.get(p.first, number.get(p.second, -1)) for p in pairs}
        return None if -1 in found else tuple(sorted(found))

    def free_mask(self, Q: FloatArray) -> BoolArray:
        """:meth:`is_free` of many configurations, shape (n, dof) to (n,)."""
        return np.array([self.is_free(q) for q in Q], dtype=bool)

    def touching_pairs(self, q: FloatArray) -> tuple[int, ...]:
        """Indices into ``body_pairs`` of all pairs that touch at q."""
        data = self._engine(FREE)[1]
        q_bodies = self.robot.body_configuration(q)
        pin.computeCollisions(
            self._model, self._data, self.bodies, data, q_bodies, False
        )
        hits = [
            int(self.pair_index[index])
            for index, result in enumerate(data.collisionResults)
            if result.isCollision()
        ]
        touching = tuple(dict.fromkeys(hits))
        if Trace.current is not None:
            Trace.current.note(self, TOUCHING, q, touching)
        return touching

    def blocking_pair(self, q: FloatArray) -> int:
        """Index into ``body_pairs`` of a pair that touches at q, or -1."""
        pairs = self.touching_pairs(q)
        return pairs[0] if pairs else _NO_PAIR

    def blocking_pair_of_many(self, Q: FloatArray) -> int:
        """The pair reported when every configuration of a set collides.

        That is the pair of the configuration with the fewest pairs in collision:
        the one nearest to being free.
        """
        candidates = [pairs for q in Q if (pairs := self.touching_pairs(q))]
        return min(candidates, key=len)[0] if candidates else _NO_PAIR


def _with_convex_hulls(geometry: Any) -> Any:
    """Copy of a geometry model with convex hulls in place of meshes."""
    copy = geometry.copy()
    for body in copy.geometryObjects:
        if isinstance(body.geometry, coal.BVHModelBase):
            hull = convex_hull(np.asarray(body.geometry.vertices(), float))
            if hull is not None:  # a flat mesh has none, and stays a mesh
                body.geometry = hull
    return copy

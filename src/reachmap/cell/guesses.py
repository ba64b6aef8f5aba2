"""Guesses about an arm from its URDF alone: base, flange, fingers."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from reachmap.cell.files.urdf import FREE_JOINTS, UrdfDescription
from reachmap.errors import SettingsError

# Ends of the names that flanges and tool points have in published robot descriptions,
# best first. A tool point comes before the flange that carries the tool.
TOOL_POINTS = ("tcp", "tcp_link", "link_tcp")
TIP_NAMES = (
    *(*TOOL_POINTS, "tool0", "tool_frame", "tool_link", "tool"),
    *("ee_link", "link_ee", "end_effector_link", "end_effector", "eef", "link_eef"),
    *("ee_gripper_link", "ee", "flange", "flange_link", "link_flange"),
)
FINGER_WORDS = re.compile(r"finger|gripper|jaw|knuckle|claw|thumb|griper|pincer")
FINGER_LINKS = re.compile(r"finger|jaw|knuckle|claw|thumb")
# An arm has at least this many joints before its hand branches into fingers of at most
# this many; a torso that branches into arms has longer branches.
ARM_JOINTS, FINGER_JOINTS = 4, 4


def guess_base(robot: UrdfDescription) -> str:
    """Link to measure from: the root, or what a root named world or free carries."""
    base = robot.root
    below = [joint for joint in robot.joints.values() if joint.parent == base]
    if len(below) == 1 and (
        below[0].type in FREE_JOINTS or (base, below[0].type) == ("world", "fixed")
    ):
        return below[0].child
    return base


def guess_tip(robot: UrdfDescription, base: str, joints: Collection[str] = ()) -> str:
    """Link to carry the tool: one with a well-known name, else the arm's last.

    Joints of fingers do not count as the arm's, and no link beyond them is a flange. A
    well-known name must end a chain at least half as long as the longest.

    Parameters
    ----------
    robot : UrdfDescription
    base : str
    joints : collection of str, optional
        The arm's joints, where they are known: then a link that they end at.

    Raises
    ------
    SettingsError
        No joint moves.
    """
    tree = _Tree.of(robot, base)
    fingers = tree.fingers()
    arms = {
        link: tree.independent(link)
        for link in robot.links
        if link in tree.chains and not fingers.intersection(tree.chains[link])
    }
    if joints:
        ends = [link for link in arms if set(joints) <= set(tree.chains[link])]
        fewest = min((arms[link] for link in ends), default=0)
        arms = {link: fewest for link in ends if arms[link] == fewest}
    longest = max(arms.values(), default=0)
    if not longest:  # nothing but fingers: then they are the arm
        arms = {link: tree.independent(link) for link in tree.chains}
        longest = max(arms.values(), default=0)
    if not longest:
        raise SettingsError(
            f"{robot.name}: the URDF has no joint that moves anything "
            f"relative to {base!r}"
        )
    known = {
        link: arms[link]
        for link in arms
        if known_tip(link) is not None and 2 * arms[link] >= longest
    }
    if known:
        most = max(known.values())
        return min((n for n in known if known[n] == most), key=_rank_of)
    # A follower at the end, as in palletisers, is part of the arm.
    ends = [link for link in arms if arms[link] == longest]
    last = max(ends, key=lambda link: len(tree.chains[link]))
    return _flange_beyond(last, arms)


def finger_joints(robot: UrdfDescription, base: str) -> set[str]:
    """Joints that open and close a hand rather than move it."""
    return _Tree.of(robot, base).fingers()


def joints_below(robot: UrdfDescription, base: str) -> set[str]:
    """Joints that move something relative to the base."""
    return {name for link in robot.links for name in robot.chain(base, link)}


def other_tips(robot: UrdfDescription, base: str, tip: str) -> list[str]:
    """Say which arms a robot has beside the one that ends at ``tip``."""
    tree = _Tree.of(robot, base)
    fingers, own = tree.fingers(), tree.chains[tip]
    fewest = max(ARM_JOINTS, tree.independent(tip) / 2)
    ends: dict[str, list[str]] = {}
    flanges = {
        tree.chains[link]
        for link in tree.chains
        if known_tip(link) is not None and tree.independent(link) >= fewest
    }
    for link, chain in tree.chains.items():
        # What moves beyond a flange is its hand.
        if known_tip(link) is None and any(
            chain[:k] in flanges for k in range(len(chain))
        ):
            continue
        enough = tree.independent(link) >= fewest
        beside = enough and chain[-1] not in own and own[-1] not in chain
        if beside and not fingers.intersection(chain):
            ends.setdefault(chain[-1], []).append(link)
    inner = {name for links in ends.values() for name in tree.chains[links[0]][:-1]}
    tips = [min(ends[last], key=_rank_of) for last in ends if last not in inner]
    if not tips:
        return []
    shown = ", ".join(tips[:6]) + (", …" if len(tips) > 6 else "")
    return [f"the arm that ends at {tip} was chosen; --tip takes another: {shown}"]


def known_tip(link: str) -> int | None:
    """Rank of a link among the well-known names, 0 the best; None if it has none."""
    words = [w for w in re.split(r"[^a-z0-9]+", link.lower()) if w]
    for rank, name in enumerate(TIP_NAMES):
        parts = name.split("_")
        if words[-len(parts) :] == parts:
            return rank
    return 3 if re.search(r"tool0(_|$)", link.lower()) else None


def is_tool_point(link: str) -> bool:
    """Whether a link is called a tool centre point, rather than what carries one."""
    rank = known_tip(link)
    return rank is not None and rank < len(TOOL_POINTS)


def _flange_beyond(last: str, arms: Mapping[str, int]) -> str:
    """The next of numbered links (link8 after link7) where it moves with the last."""
    number = re.search(r"(\d+)$", last)
    if number is not None:
        following = last[: number.start()] + str(int(number[1]) + 1)
        if arms.get(following) == arms[last]:
            return following
    return last


def _rank_of(link: str) -> int:
    rank = known_tip(link)
    return len(TIP_NAMES) if rank is None else rank


@dataclass(frozen=True, slots=True, kw_only=True)
class _Tree:
    """A URDF as seen from the base.

    Attributes
    ----------
    chains : mapping
        Link to the joints that move it relative to the base, with followers; links
        beside or above the base have none.
    below : mapping
        Link to the joints that it carries.
    """

    robot: UrdfDescription
    chains: Mapping[str, tuple[str, ...]]
    below: Mapping[str, Collection[str]]

    @classmethod
    def of(cls, robot: UrdfDescription, base: str) -> _Tree:
        """Walk outwards from the base."""
        below: dict[str, list[str]] = {link: [] for link in robot.links}
        for joint in robot.joints.values():
            below[joint.parent].append(joint.name)
        chains: dict[str, tuple[str, ...]] = {base: ()}
        todo = [base]
        while todo:
            link = todo.pop()
            for name in below[link]:
                joint = robot.joints[name]
                moves = joint.moves or joint.mimics is not None
                chains[joint.child] = chains[link] + ((name,) if moves else ())
                todo.append(joint.child)
        return cls(robot=robot, chains=chains, below=below)

    def independent(self, link: str) -> int:
        """Number of joints that move a link by themselves."""
        return sum(self.robot.joints[name].moves for name in self.chains[link])

    def fingers(self) -> set[str]:
        """Joints that open and close a hand rather than move it."""
        found = set(self._named()) | set(self._leaders()) | set(self._branches())
        carrying = {
            name
            for link, chain in self.chains.items()
            if known_tip(link) is not None and not self._beyond_hand(link)
            for name in chain
        }
        found -= carrying
        followers = (j for j in self.robot.joints.values() if j.mimics in found)
        return found | {joint.name for joint in followers} - carrying

    def _beyond_hand(self, link: str) -> bool:
        """Whether a link with a tip's name is part of a finger (finger_tool)."""
        return FINGER_LINKS.search(link.lower()) is not None or any(
            FINGER_WORDS.search(name.lower()) for name in self.chains[link]
        )

    def _named(self) -> list[str]:
        """Joints called after fingers, or that move links called so."""
        return [
            joint.name
            for joint in self.robot.joints.values()
            if FINGER_WORDS.search(joint.name.lower())
            or FINGER_LINKS.search(joint.child.lower())
        ]

    def _leaders(self) -> list[str]:
        """Joints that others beside them follow, and that carry no joint of the arm.

        Arms with parallelograms have followers, too, but go on beyond the leader.
        """
        robot = self.robot
        beyond: dict[str, set[str]] = {}
        for chain in self.chains.values():
            for k, name in enumerate(chain):
                beyond.setdefault(name, set()).update(chain[k + 1 :])
        found = []
        for joint in robot.joints.values():
            leader = joint.mimics
            # A rod of a parallelogram may lead another one; fingers lead by themselves.
            if leader in beyond and robot.joints[leader].moves:
                outer = beyond[leader]
                if joint.name not in outer and not any(
                    robot.joints[name].moves for name in outer
                ):
                    found.append(leader)
        return found

    def _branches(self) -> list[str]:
        """Joints of the short branches that a hand has after the joints of an arm."""
        found: list[str] = []
        for hand, chain in self.chains.items():
            parts = [self._moving_from(name) for name in self.below[hand]]
            parts = [part for part in parts if part]
            joints = [self.robot.joints[part[0]] for part in parts]
            slides = all(j.type == "prismatic" for j in joints) and all(
                len(part) == 1 for part in parts
            )
            short = len(chain) >= ARM_JOINTS and all(
                len(part) <= FINGER_JOINTS for part in parts
            )
            if len(parts) > 1 and (slides or short):
                found += [name for part in parts for name in part]
        return found

    def _moving_from(self, name: str) -> list[str]:
        """Joints that move, from one joint outwards."""
        joint = self.robot.joints[name]
        outer = [n for k in self.below[joint.child] for n in self._moving_from(k)]
        moves = joint.moves or joint.mimics is not None
        return [name, *outer] if moves else outer

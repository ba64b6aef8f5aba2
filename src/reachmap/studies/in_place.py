"""A work computed immediately in this process, without a journal."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from reachmap.core.memo import fingerprint, memoized
from reachmap.core.scene import Scene
from reachmap.runtime.encoding import decode, encode
from reachmap.runtime.job import Job, Work, one_frame
from reachmap.runtime.journal import UNITS
from reachmap.runtime.progress import Progress


class _InPlace:
    """The :class:`~reachmap.runtime.job.Stages` of such a work.

    A payload depends on the cell and the payloads before it, which make its key.
    """

    def __init__(self, work: Work, scene: Scene, left_out: Sequence[str]) -> None:
        self.single: dict[str, Any] = {}
        self._scene = scene
        loaded = scene.loaded
        # Of cells with other scenes, with a part on the tool or other fillings, a
        # scene's checker does not answer all questions.
        self._is_all = loaded.cell.held() is None and len(loaded.fillings()) == 1
        known = fingerprint(loaded, without=left_out, surroundings=False)
        self._so_far = hashlib.sha256(f"{work.kind.name} {known}".encode())

    def run(
        self, phase: str, job: Job, units: Sequence[Any], *, most: int | None = None
    ) -> list[Any]:
        """Payloads of all units of a job."""
        state = job.prepare(job.context)
        # As they would come from a store, bit for bit.
        texts = [
            self._text(f"{phase} {k}", partial(job.function, state, unit))
            for k, unit in enumerate(units)
        ]
        return [decode(text) for text in texts]

    def once(
        self,
        phase: str,
        function: Callable[[Progress], Any],
        tally: Callable[[Any], tuple[int, int]] = one_frame,
    ) -> Any:
        """Payload of a single unit."""
        text = self._text(phase, lambda: function(Progress(phase, quiet=True)))
        payload = self.single[phase] = decode(text)
        return payload

    def _text(self, name: str, compute: Callable[[], Any]) -> str:
        key = f"{name} {self._so_far.hexdigest()}"
        text = (
            memoized(key, self._scene, lambda: encode(compute()))
            if self._is_all
            else encode(compute())
        )
        self._so_far.update(text.encode())
        return text


def payloads_in_place(
    work: Work, scene: Scene, left_out: Sequence[str] = ()
) -> list[Any]:
    """Payloads of all units, the same as those of a run with a store.

    An exception in a unit is raised as it is.

    Parameters
    ----------
    work : Work
    scene : Scene
        That the work looks at.
    left_out : sequence of str
        Parts of the cell that the work does not read.
    """
    stages = _InPlace(work, scene, left_out)
    job = work.job(stages)
    if job is None:
        return [stages.single[UNITS]]
    return stages.run(UNITS, job, work.units)

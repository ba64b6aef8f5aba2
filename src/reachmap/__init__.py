"""Path-reachability maps for bin-picking cells.

A robot cell goes in, maps come out, and every later question is answered from a
map: where the bin goes, which grasps the arm really reaches, which to pick first.

What is named in ``__all__`` is the public interface; everything else is internal and
may change between minor versions. Names are imported when they are first used, so
``import reachmap`` loads no engine, and ranking never does.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from reachmap.cell.loaded import LoadedCell
    from reachmap.cell.loading import read_cell as load_cell
    from reachmap.core.scene import Scene
    from reachmap.errors import ReachmapError
    from reachmap.maps.format.registry import read_artefact as read_map
    from reachmap.maps.records import BinMap, BinPlacement, Status, WorkspaceMap
    from reachmap.motions.library import MotionLibrary
    from reachmap.ranking.lookup.costs import Ranking
    from reachmap.ranking.lookup.ranker import Ranker
    from reachmap.ranking.lookup.settings import RankSettings
    from reachmap.runtime.options import RunOptions
    from reachmap.tools.bin_scan import bin_scan
    from reachmap.tools.check import check
    from reachmap.tools.compare import compare
    from reachmap.tools.empty import empty
    from reachmap.tools.export import export
    from reachmap.tools.heatmap import heatmap
    from reachmap.tools.info import info
    from reachmap.tools.merge import merge
    from reachmap.tools.new_cell import new_cell
    from reachmap.tools.place_bin import place_bin
    from reachmap.tools.place_bins import place_bins
    from reachmap.tools.place_robot import place_robot
    from reachmap.tools.rank import rank
    from reachmap.tools.robust import robust
    from reachmap.tools.run import run_pipeline
    from reachmap.tools.study import study
    from reachmap.tools.validate import validate
    from reachmap.tools.verify import verify
    from reachmap.tools.workspace_scan import workspace_scan

__version__ = "0.2.0"

_HOMES: Final[dict[str, str]] = {
    "BinMap": "maps.records",
    "BinPlacement": "maps.records",
    "LoadedCell": "cell.loaded",
    "MotionLibrary": "motions.library",
    "RankSettings": "ranking.lookup.settings",
    "Ranker": "ranking.lookup.ranker",
    "Ranking": "ranking.lookup.costs",
    "ReachmapError": "errors",
    "RunOptions": "runtime.options",
    "Scene": "core.scene",
    "Status": "maps.records",
    "WorkspaceMap": "maps.records",
    "bin_scan": "tools.bin_scan",
    "check": "tools.check",
    "compare": "tools.compare",
    "empty": "tools.empty",
    "export": "tools.export",
    "heatmap": "tools.heatmap",
    "info": "tools.info",
    "load_cell": "cell.loading:read_cell",
    "merge": "tools.merge",
    "new_cell": "tools.new_cell",
    "place_bin": "tools.place_bin",
    "place_bins": "tools.place_bins",
    "place_robot": "tools.place_robot",
    "rank": "tools.rank",
    "read_map": "maps.format.registry:read_artefact",
    "robust": "tools.robust",
    "run_pipeline": "tools.run",
    "study": "tools.study",
    "validate": "tools.validate",
    "verify": "tools.verify",
    "workspace_scan": "tools.workspace_scan",
}
"""Public name to the module that defines it, and its name there if it differs."""

__all__ = [
    "BinMap",
    "BinPlacement",
    "LoadedCell",
    "MotionLibrary",
    "RankSettings",
    "Ranker",
    "Ranking",
    "ReachmapError",
    "RunOptions",
    "Scene",
    "Status",
    "WorkspaceMap",
    "__version__",
    "bin_scan",
    "check",
    "compare",
    "empty",
    "export",
    "heatmap",
    "info",
    "load_cell",
    "merge",
    "new_cell",
    "place_bin",
    "place_bins",
    "place_robot",
    "rank",
    "read_map",
    "robust",
    "run_pipeline",
    "study",
    "validate",
    "verify",
    "workspace_scan",
]


def __getattr__(name: str) -> Any:
    """Import a public name on its first use (PEP 562)."""
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, attribute = home.partition(":")
    value = getattr(import_module(f"{__name__}.{module}"), attribute or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

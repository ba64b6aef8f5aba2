"""The loaded cell: description, texts and hashes, ready to be sent to workers."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr, unescape

from reachmap._typing import FloatArray
from reachmap.cell.files.files import body_key
from reachmap.cell.files.joint_limits import MoveItLimits
from reachmap.cell.files.resources import NotFoundError, Resolver, shipped_folder
from reachmap.cell.files.urdf import UrdfDescription, parse_urdf
from reachmap.cell.model.bodies import BinSpec
from reachmap.cell.model.cell import Cell, JointValues, ScanConfiguration
from reachmap.cell.text.overrides import apply_overrides, is_override
from reachmap.cell.text.yaml_reader import is_within, parse_yaml, spelled
from reachmap.errors import CellError

SUFFIXES = (".yaml", ".yml")


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadedCell:
    """A cell with everything it refers to; can be pickled and sent to workers.

    Attributes
    ----------
    cell : Cell
        The description after defaults and overrides. Group states, groups and MoveIt
        limits are written out as ``scan_configuration.q_rad``, ``robot.joints`` and
        ``robot.limits``; relative references are absolute.
    source : str
        Name or path as it was asked for.
    directory : Path
        Folder that relative references started from.
    text : str
        The YAML as read.
    overrides : tuple of str
    resolved_json : str
        ``cell`` as JSON; :func:`reachmap.cell.loading.cell_from_json` reads it.
    sha256 : str
        Of the contents: the resolved cell with each file reference replaced by the
        sha256 of the file. Equal on every machine.
    urdf, srdf : str
        Texts after xacro; ``srdf`` is "" where there is none.
    files_sha256 : mapping
        Mesh as the URDF names it, or ``body NAME: FILE``, to the sha256 of its bytes.
    mesh_paths : mapping
        The same keys to absolute paths.
    joint_limits : mapping
        MoveIt's ``joint_limits`` as read; they are also merged into ``cell``.
    warnings : tuple of str
        Warnings about things that are allowed but suspicious.
    """

    cell: Cell
    source: str
    directory: Path
    text: str
    overrides: tuple[str, ...] = ()
    resolved_json: str
    sha256: str
    urdf: str
    srdf: str = ""
    files_sha256: Mapping[str, str] = dataclasses.field(default_factory=dict)
    mesh_paths: Mapping[str, Path] = dataclasses.field(default_factory=dict)
    joint_limits: Mapping[str, MoveItLimits] = dataclasses.field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<LoadedCell: {self.cell.name}, contents {self.sha256[:12]}>"

    @property
    def resolver(self) -> Resolver:
        """Looks up references of the cell file."""
        plain = Resolver(
            directory=self.directory, packages=self.cell.resources.packages
        )
        return plain.around(self.cell.robot.urdf)

    @property
    def robot(self) -> UrdfDescription:
        """Structure of the URDF."""
        return parse_urdf(self.urdf, self.cell.robot.urdf)

    @property
    def scan_configuration_rad(self) -> dict[str, float]:
        """Joint name to position in the scan configuration [rad or m]."""
        return self.joint_values_rad(self.cell.scan_configuration)

    def joint_values_rad(self, given: JointValues) -> dict[str, float]:
        """Joint name to position where a cell gives joint values [rad or m]."""
        if given.q_rad is not None:
            return dict(given.q_rad)
        joints = self.robot.joints
        return {
            name: value if joints[name].type == "prismatic" else math.radians(value)
            for name, value in (given.q_deg or {}).items()
        }

    def place_of(self, key: str) -> str:
        """Where a key was given: by which overrides, or file, line and column.

        What encloses the key counts where it was not given itself; the source alone
        where there is nothing, or no file of the user's.
        """
        has_lines = Path(self.source).suffix in SUFFIXES
        if not has_lines and not (shipped_folder() / f"{self.source}.yaml").is_file():
            return self.source
        document = parse_yaml(self.text, self.source)
        apply_overrides(document, self.overrides, Cell)
        names = {at: spelled(at, document.data) for at in document.places}
        around = [at for at, name in names.items() if name and is_within(key, name)]
        if not around:
            return self.source
        location = max(around, key=len)
        given = [
            str(place)
            for at, place in document.places.items()
            if is_override(place) and (at == location or is_within(names[at], key))
        ]
        if given:
            return " ".join(dict.fromkeys(given))
        return str(document.places[location]) if has_lines else self.source

    def resolve(self, reference: str) -> Path:
        """Absolute path of a file named in the cell file; CellError if none."""
        try:
            return self.resolver.resolve(reference)
        except NotFoundError as error:
            raise CellError(f"{self.source}: {error}") from None

    def with_changes(
        self,
        *,
        bin_pose: FloatArray | None = None,
        scan_configuration_rad: Mapping[str, float] | None = None,
    ) -> LoadedCell:
        """Copy with another bin pose or scan configuration, and its own sha256.

        Parameters
        ----------
        bin_pose : array, shape (4, 4), optional
            T_base_bin.
        scan_configuration_rad : mapping, optional
            Joint name to position [rad or m].
        """
        cell = self.cell
        if bin_pose is not None:
            cell = cell.with_spec_at(cell.bin, bin_pose, "robot_base")
            # Where it stands now is for the pose to say.
            free = cell.bin.model_copy(update={"on": None})
            cell = cell.model_copy(update={"bin": free})
        if scan_configuration_rad is not None:
            q = {name: float(value) for name, value in scan_configuration_rad.items()}
            changed = ScanConfiguration(q_rad=q)
            cell = cell.model_copy(update={"scan_configuration": changed})
        return self.with_cell(cell)

    def with_other_bins(self, bins: Mapping[str, BinSpec]) -> LoadedCell:
        """Copy with other bins beside its own."""
        if self.cell.bins == bins:
            return self
        return self.with_cell(self.cell.model_copy(update={"bins": dict(bins)}))

    def fillings(self) -> tuple[LoadedCell, ...]:
        """One cell per filling level of the bin, with that level as its only layer.

        The parts below the level are an obstacle. A cell whose layers are not levels
        of a filling is its own only one.
        """
        spec = self.cell.bin_scan
        if not spec.is_filled:
            return (self,)
        return tuple(self.filled_to(k) for k in range(len(spec.layers)))

    def filled_to(self, layer: int) -> LoadedCell:
        """The cell with its bin filled to one of its layers, which it keeps alone."""
        return self.filled_up_to(self.cell.bin_scan.layers[layer])

    def filled_up_to(self, height_m: float) -> LoadedCell:
        """The cell with its bin filled up to a height, which is its only layer.

        Where its layers are not levels of a filling, no parts are added.
        """
        cell, spec = self.cell, self.cell.bin_scan
        height_m = min(max(height_m, 0.0), cell.bin.inner[2])
        heap = max(spec.heap_below_m(height_m), cell.bin.heap)
        levels = {"layers": (height_m,), "fill": None, "fill_heights_m": None}
        changed = cell.model_copy(
            update={
                "bin": cell.bin.model_copy(update={"heap": heap}),
                "bin_scan": spec.model_copy(update=levels),
            }
        )
        return self.with_cell(changed)

    def with_cell(self, cell: Cell) -> LoadedCell:
        """Copy with another description, and its own sha256."""
        return dataclasses.replace(
            self,
            cell=cell,
            resolved_json=cell.model_dump_json(),
            sha256=fingerprint(cell, self.urdf, self.srdf, self.files_sha256),
        )


def fingerprint(
    cell: Cell, urdf: str, srdf: str, files_sha256: Mapping[str, str]
) -> str:
    """Sha256 of the contents of a cell, independent of file names and folders.

    File references give way to the sha256 of their bytes; description, package
    folders, parameters, the carrier's name and xacro arguments, whose effect is
    elsewhere, are left out.
    """
    data: dict[str, Any] = json.loads(cell.model_dump_json())
    del data["description"], data["resources"]
    # The numbers that parameters lead to stand in their places.
    del data["parameters"], data["expressions"]
    # The choice is made, and a single bin has no name.
    del data["pick_from"]
    if not data["bins"]:
        del data["bins"], data["bin"]["name"]
    others = data.get("bins", {})
    for tray in (data["bin"], *others.values()):
        del tray["carrier"]
    _reduce_cycle(cell, data)
    robot = data["robot"]
    # Base pose and body stand for it.
    robot.pop("mount", None)
    del robot["xacro_args"], robot["joint_limits"], robot["group"]
    hashes = {name: f"sha256:{digest}" for name, digest in files_sha256.items()}
    robot["urdf"] = sha256_text(_with_filenames(urdf, hashes))
    robot["srdf"] = sha256_text(srdf) if srdf else None
    meshes = [(body["name"], body["shape"]["mesh"]) for body in data["bodies"]]
    if (held := cell.held()) is not None:
        meshes.append((held[0], data["part"]["shape"]["mesh"]))
    meshes += [("bin", data["bin"]["mesh"])]
    meshes += [(f"bin {name}", tray["mesh"]) for name, tray in others.items()]
    for name, mesh in meshes:
        if mesh is not None:
            mesh["file"] = files_sha256[body_key(name, mesh["file"])]
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return sha256_text(text)


def _reduce_cycle(cell: Cell, data: dict[str, Any]) -> None:
    """Drop keys of the pick cycle that have no effect: all of them without a part."""
    del data["parts"]
    held = cell.held()
    if held is None:
        for key in ("part", "lift", "drop_off", "cycle"):
            del data[key]
        return
    data["part"] = json.loads(held[1].model_dump_json())
    data["drop_off"] = [json.loads(p.model_dump_json()) for p in cell.drop_offs]


def sha256_text(text: str) -> str:
    """Sha256 of a text in UTF-8, as 64 hexadecimal digits."""
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def _with_filenames(urdf: str, names: Mapping[str, str]) -> str:
    """URDF text whose ``filename`` attributes are replaced where ``names`` has them.

    The folders of all others are dropped.
    """

    def replace(match: re.Match[str]) -> str:
        given = unescape(match[3], {"&quot;": '"', "&apos;": "'"})
        name = names.get(given, given.rsplit("/", 1)[-1])
        return f"{match[1]}={quoteattr(name)}"

    return re.sub(r"(\bfilename)(\s*=\s*[\"'])(.*?)[\"']", replace, urdf)

"""Trees as HDF5 images and back; the only module that touches h5py.

Images are built and parsed in memory. Writing them is then plain file output, which
fails cleanly on a full disk (the HDF5 library crashes at exit there), and reading
needs no file locks, which network file systems refuse.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import h5py
import numpy as np

from reachmap.maps.bytes.to_json import plain
from reachmap.maps.bytes.tree import Array, Leaf, Tree

# What a reader has to hold at once.
CHUNK_BYTES = 16 * 2**20
# A choice against hostile input: workspace maps have fewer than a hundred.
MAX_OBJECTS = 10_000
# A choice: more does not fit into the memory of most machines.
MAX_BYTES = 16 * 2**30
"""Largest artefact that is read into memory [bytes, uncompressed]."""

# Deflate packs at most 1032 to 1; what claims more was never written by us.
_MAX_RATIO = 1100
_INTERNAL = {
    "CLASS", "NAME", "REFERENCE_LIST", "DIMENSION_LIST", "DIMENSION_LABELS",
    "_Netcdf4Dimid", "_Netcdf4Coordinates", "_NCProperties",
}  # fmt: skip
_TEXT = h5py.string_dtype()
# What the netCDF library calls the scale of a dimension that is not a variable.
_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable."


class StructureError(Exception):
    """An HDF5 image holds something that no artefact holds."""


def image_from_tree(tree: Tree) -> bytes:
    """Build the HDF5 image of a tree; the same tree gives the same bytes."""
    with h5py.File(
        "artefact.h5",
        "w",
        driver="core",
        backing_store=False,
        libver=("earliest", "v110"),
        track_order=True,
    ) as file:
        _write_attributes(file, tree.attributes)
        for path, attributes in tree.groups.items():
            _write_attributes(file.create_group(path, track_order=True), attributes)
        for path, leaf in tree.leaves.items():
            dataset = _write_value(file, path, leaf)
            _write_attributes(dataset, leaf.attributes)
            if leaf.dims == (path.rpartition("/")[2],):
                size = f"{_NO_VARIABLE}{len(dataset):10d}"
                dataset.make_scale(size if leaf.is_hidden else leaf.dims[0])
        _attach_scales(file, tree)
        file.flush()
        return bytes(file.id.get_file_image())


def _write_value(file: Any, path: str, leaf: Leaf) -> Any:
    fixed = {"track_times": False, "track_order": True}
    if isinstance(leaf.value, str):
        return file.create_dataset(path, data=leaf.value, dtype=_TEXT, **fixed)
    array = leaf.value
    if array.dtype.kind == "U":
        return file.create_dataset(
            path, data=array.astype(object), dtype=_TEXT, **fixed
        )
    # A chunk must not be larger than the data, so an empty axis is made extensible.
    growing = tuple(None if n == 0 else n for n in array.shape)
    return file.create_dataset(
        path,
        data=array,
        dtype=array.dtype.newbyteorder("<"),
        chunks=chunk_shape(array),
        maxshape=growing if array.size == 0 else None,
        compression="gzip",
        compression_opts=4,
        shuffle=True,
        fletcher32=True,
        **fixed,
    )


def chunk_shape(array: Array) -> tuple[int, ...]:
    """One chunk per level or layer of a map, the whole of anything smaller.

    Examples
    --------
    >>> chunk_shape(np.zeros((11, 6, 11, 27)))
    (1, 6, 11, 27)
    >>> chunk_shape(np.zeros((500, 6)))
    (500, 6)
    """
    shape = [max(1, n) for n in array.shape]
    if len(shape) > 2:
        shape[0] = 1
    for axis in range(len(shape)):
        while math.prod(shape) * array.itemsize > CHUNK_BYTES and shape[axis] > 1:
            shape[axis] = math.ceil(shape[axis] / 2)
    return tuple(shape)


def _write_attributes(target: Any, attributes: Any) -> None:
    for name, value in attributes.items():
        if isinstance(value, list | tuple) and all(isinstance(v, str) for v in value):
            target.attrs.create(name, np.array(value, dtype=object), dtype=_TEXT)
        else:
            target.attrs[name] = value


def _attach_scales(file: Any, tree: Tree) -> None:
    for path, leaf in tree.leaves.items():
        group, _, name = path.rpartition("/")
        if leaf.dims == (name,):
            continue
        for axis, dimension in enumerate(leaf.dims):
            file[path].dims[axis].attach_scale(
                file[_scale_path(tree, group, dimension)]
            )


def _scale_path(tree: Tree, group: str, dimension: str) -> str:
    """Path of a dimension's scale: in the group itself, or in the nearest above."""
    while True:
        path = f"{group}/{dimension}" if group else dimension
        if path in tree.leaves or not group:
            return path
        group = group.rpartition("/")[0]


def tree_from_image(image: bytes) -> Tree:
    """Read everything an HDF5 image holds.

    Raises
    ------
    StructureError
        The image is damaged or holds what no artefact holds: links out of the file,
        data kept elsewhere, missing or absurdly large data.
    """
    try:
        with h5py.File(h5py.h5f.open_file_image(image)) as file:
            return _read_tree(file)
    except StructureError:
        raise
    except Exception as error:
        # On damaged data h5py raises whatever its layers raise: OSError, KeyError,
        # RuntimeError, ValueError, UnicodeDecodeError, MemoryError and more.
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise StructureError(f"HDF5 cannot read it: {reason}") from error


def identity_from_image(image: bytes) -> dict[str, str]:
    """``format`` and ``format_version`` of an HDF5 image, if it has them.

    Raises
    ------
    StructureError
        There is no reading it.
    """
    try:
        with h5py.File(h5py.h5f.open_file_image(image)) as file:
            names = [n for n in ("format", "format_version") if n in file.attrs]
            return {name: str(file.attrs[name]) for name in names}
    except Exception as error:
        raise StructureError("HDF5 cannot read it") from error


def _read_tree(file: Any) -> Tree:
    tree = Tree(attributes=_read_attributes(file))
    total = 0
    for path, item in _walk(file, "", set()):
        if isinstance(item, h5py.Group):
            tree.groups[path] = _read_attributes(item)
        else:
            total += _checked_bytes(path, item)
            if total > MAX_BYTES:
                raise StructureError(f"it holds more than {MAX_BYTES >> 30} GiB")
            tree.leaves[path] = _read_leaf(path, item)
    return tree


def _walk(group: Any, prefix: str, seen: set[int]) -> Iterator[tuple[str, Any]]:
    """Every group and dataset below a group; hard links only, each object once."""
    for name in group:
        path = f"{prefix}{name}"
        if not path.isprintable():
            raise StructureError(f"an object has the name {path!a}")
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise StructureError(f"{path} is a link to another place")
        item = group[name]
        address = h5py.h5o.get_info(item.id).addr
        if address in seen or len(seen) >= MAX_OBJECTS:
            raise StructureError(f"{path} is one object too many")
        seen.add(address)
        if not isinstance(item, h5py.Group | h5py.Dataset):
            raise StructureError(f"{path} is neither an array nor a group")
        yield path, item
        if isinstance(item, h5py.Group):
            yield from _walk(item, f"{path}/", seen)


def _checked_bytes(path: str, dataset: Any) -> int:
    """Size in memory [bytes], once nothing about the dataset is suspicious."""
    if dataset.is_virtual or dataset.external:
        raise StructureError(f"the data of {path} are in another file")
    if dataset.dtype.kind not in "fiuO":
        raise StructureError(f"{path} has the type {dataset.dtype}")
    size = int(dataset.size) * int(dataset.dtype.itemsize)
    stored = int(dataset.id.get_storage_size())
    if size > _MAX_RATIO * max(stored, 1):
        raise StructureError(f"{path} lacks data ({stored} bytes for {size})")
    if dataset.chunks is not None:
        wanted = math.prod(
            math.ceil(n / c) for n, c in zip(dataset.shape, dataset.chunks, strict=True)
        )
        if dataset.id.get_num_chunks() != wanted:
            raise StructureError(f"{path} lacks chunks of its data")
    return size


def _read_leaf(path: str, dataset: Any) -> Leaf:
    name = path.rpartition("/")[2]
    attributes = _read_attributes(dataset)
    is_text = dataset.dtype.kind == "O"
    if is_text and (h5py.check_string_dtype(dataset.dtype) is None or dataset.ndim > 1):
        raise StructureError(f"{path} is neither a text nor a list of texts")
    if is_text and dataset.ndim == 0:
        return Leaf(value=dataset.asstr()[()], attributes=attributes)
    if is_text:
        value = np.array(dataset.asstr()[()].tolist(), dtype=str)
    else:
        # 0-dimensional arrays come back as scalars; ask for an array either way.
        value = np.asarray(dataset[()])
    if dataset.is_scale and dataset.ndim == 1:
        dims: tuple[str, ...] = (name,)
    else:
        dims = tuple(_dimension_name(dimension) for dimension in dataset.dims)
    scale_name = dataset.attrs.get("NAME", b"")
    return Leaf(
        value=value,
        dims=dims,
        attributes=attributes,
        is_hidden=bytes(scale_name).startswith(_NO_VARIABLE.encode()),
    )


def _dimension_name(dimension: Any) -> str:
    return ascii(dimension[0].name)[1:-1].rpartition("/")[2] if len(dimension) else ""


def _read_attributes(target: Any) -> dict[str, Any]:
    values = {}
    for name in target.attrs:
        if name in _INTERNAL:
            continue
        try:
            values[str(name)] = value = plain(target.attrs[name])
            _require_utf8([name, value])
        except (TypeError, UnicodeEncodeError) as error:
            raise StructureError(
                f"its attribute {name!a} cannot be read, or is not UTF-8"
            ) from error
    return values


def _require_utf8(value: Any) -> None:
    """Raise UnicodeEncodeError for bytes that h5py passes on as lone surrogates."""
    if isinstance(value, str):
        value.encode()
    elif isinstance(value, list):
        for item in value:
            _require_utf8(item)

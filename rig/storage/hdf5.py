"""The HDF5 layout of a data set: NeXus groups, CF time, checksums over everything.

    /                     Conventions, schema, schema_version, uuid, created, title, origin ...
    /entry                NXentry
      samples             NXdata: one column a dataset, `time` their dimension scale
      texts               protocol, station, meta: verbatim
      record              events, devices, calibration as JSON text
      devices/<name>      NXcollection: identity as attributes, for whoever browses the file
      manifest            SHA-256 of every object above, attributes included

Text columns are strings of variable length, which every reader shows as text; beyond 200 000 rows
UTF-8 bytes of fixed length, which take 30 bytes less a cell (xarray on h5netcdf then shows bytes).
Flags are stored as 0 and 1: netCDF has no truth values. Objects that the manifest does not name are
ignored: results of other programs may be put beside.

Behind the end of the HDF5 data stands one line with the SHA-256 of all bytes before it. The HDF5
library ignores it, but must be kept from damaged files: some flipped bytes send it into an endless
loop. A program that changes the file cuts the line off; then the manifest alone decides.
"""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from rig.dataset import TEXTS, Dataset
from rig.storage.columns import Values
from rig.storage.files import in_place_of
from rig.storage.seal import SCHEMA, SEAL

SCHEMA_VERSION = 1
SAMPLES = "entry/samples"
MANIFEST = "entry/manifest"
_CHUNK_ROWS = 65_536
_LONGEST_FIXED_TEXT = 64
_MOST_STRINGS = 200_000
# Written by the library itself, with addresses that differ from file to file.
_LIBRARY_ATTRIBUTES = {"DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME", "_Netcdf4Dimid"}


def write_file(dataset: Dataset, path: Path) -> None:
    """See `rig.dataset.write`."""
    _check_lengths(dataset)
    with in_place_of(path) as temporary:
        temporary.write_bytes(_image(dataset))
        _write_seal(temporary)


def _image(dataset: Dataset) -> bytes:
    """The file's bytes. Made in memory, twice for a moment: on a disk that fills up, the library
    itself prints pages of errors and may crash the process."""
    version = ("earliest", "v110")
    with h5py.File("image", "w", libver=version, driver="core", backing_store=False) as file:
        _write_root(file, dataset)
        _write_samples(file.create_group(SAMPLES), dataset)
        _write_texts(file, dataset)
        _write_manifest(file)
        file.flush()
        return bytes(file.id.get_file_image())


def _check_lengths(dataset: Dataset) -> None:
    rows = dataset.rows
    for name, column in dataset.columns.items():
        if column.shape != (rows,):
            raise ValueError(f"column {name} has the shape {column.shape} instead of ({rows},)")


def _write_root(file: h5py.File, dataset: Dataset) -> None:
    mark = "EMULATED: " if dataset.origin == "emulated" else ""
    title = f"{mark}{dataset.title or 'stiffness measurement'}"
    file.attrs.update(
        {
            "Conventions": "CF-1.11",
            "NX_class": "NXroot",
            "default": "entry",
            "schema": SCHEMA,
            "schema_version": SCHEMA_VERSION,
            "rows": dataset.rows,
            "uuid": dataset.uuid,
            "created": dataset.created,
            "title": title,
            "origin": dataset.origin,
            "complete": int(dataset.complete),
            "stop_reason": dataset.stop_reason,
            "software": dataset.software,
        }
    )
    entry = file.create_group("entry")
    entry.attrs.update({"NX_class": "NXentry", "default": "samples", "origin": dataset.origin})
    _put_text(entry, "title", title)
    _put_text(entry, "start_time", dataset.created)


def _write_samples(group: h5py.Group, dataset: Dataset) -> None:
    group.attrs.update(
        {
            "NX_class": "NXdata",
            "signal": "displacement_mm",
            "axes": np.array(["time"], dtype=h5py.string_dtype()),
            "time_indices": 0,
            "title": group.file.attrs["title"],
        }
    )
    time = _write_time(group, dataset)
    taken = {"time"}
    for index, (name, values) in enumerate(dataset.columns.items()):
        stored = _free_name(name, taken)
        column = _put_column(group, stored, values)
        column.attrs["column_index"] = index
        for key, texts in (("units", dataset.units), ("long_name", dataset.long_names)):
            if texts.get(name):
                column.attrs[key] = texts[name]
        if stored != name:
            column.attrs["column_name"] = name
        column.dims[0].attach_scale(time)


def _write_time(group: h5py.Group, dataset: Dataset) -> h5py.Dataset:
    """Seconds since the session's begin where that is known, else seconds of the run."""
    columns = dataset.columns
    time = _put_column(group, "time", columns.get("session_s", columns["time_s"]))
    time.attrs["long_name"] = "time"
    time.attrs["units"] = "s"
    if "session_s" in columns and not dataset.imported:  # a table does not say when it began
        time.attrs["units"] = f"seconds since {dataset.created}"
        time.attrs["calendar"] = "proleptic_gregorian"
        time.attrs["standard_name"] = "time"
    time.make_scale("time")
    return time


def _free_name(name: str, taken: set[str]) -> str:
    """A name that NeXus, netCDF and HDF5 all allow, and that is free."""
    base = re.sub(r"[^A-Za-z0-9_.]", "_", name).strip(".")[:60] or "column"
    stored, n = base, 1
    while stored in taken:
        n += 1
        stored = f"{base}_{n}"
    taken.add(stored)
    return stored


def _put_column(group: h5py.Group, name: str, values: Values) -> h5py.Dataset:
    data = _storable(values)
    if data.dtype == object or len(data) == 0:  # neither can be chunked and filtered
        dtype = h5py.string_dtype() if data.dtype == object else data.dtype
        column = group.create_dataset(name, data=data, dtype=dtype)
    else:
        column = group.create_dataset(
            name,
            data=data,
            chunks=(min(len(data), _CHUNK_ROWS),),
            compression="gzip",
            compression_opts=1,
            shuffle=True,
            fletcher32=True,
        )
    if values.dtype.kind == "b":
        column.attrs["kind"] = "flag"
    return column


def _storable(values: Values) -> Values:
    """Numbers as they are, flags as 0 and 1, text as Python strings or as bytes of fixed length."""
    if values.dtype.kind == "b":
        return values.astype(np.int8)
    if values.dtype.kind not in "UO":
        return values
    texts = values.astype(str)
    if len(texts) <= _MOST_STRINGS or texts.dtype.itemsize > 4 * _LONGEST_FIXED_TEXT:
        return texts.astype(object)
    try:
        return texts.astype(np.bytes_)
    except UnicodeEncodeError:  # not ASCII: slower
        return np.char.encode(texts, "utf-8")


def _put_text(group: h5py.Group, name: str, text: str) -> None:
    group.create_dataset(name, data=text.replace("\0", ""), dtype=h5py.string_dtype())


def _write_texts(file: h5py.File, dataset: Dataset) -> None:
    texts = file.create_group("entry/texts")
    texts.attrs["NX_class"] = "NXcollection"
    for name in dict.fromkeys((*TEXTS, *dataset.texts)):
        _put_text(texts, name, dataset.texts.get(name, ""))
    record = file.create_group("entry/record")
    record.attrs["NX_class"] = "NXcollection"
    for name, value in (
        ("events", dataset.events),
        ("devices", dataset.devices),
        ("calibration", dataset.calibration),
    ):
        _put_text(record, name, json.dumps(value, ensure_ascii=False))
    devices = file.create_group("entry/devices")
    devices.attrs["NX_class"] = "NXcollection"
    for name, identity in dataset.devices.items():
        group = devices.create_group(_free_name(name, set(devices)))
        group.attrs["NX_class"] = "NXcollection"
        group.attrs.update({_free_name(k, set()): v for k, v in identity.items()})


def _write_manifest(file: h5py.File) -> None:
    names: list[str] = ["/"]
    file.visit(names.append)
    digests = {name: digest_of(file[name], content_of(file[name])) for name in names}
    text = json.dumps(digests)
    _put_text(file["entry"], "manifest", text)
    file[MANIFEST].attrs["sha256"] = hashlib.sha256(text.encode()).hexdigest()


def _write_seal(path: Path) -> None:
    with path.open("rb+") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        file.write(SEAL + digest.encode() + b"\n")


def content_of(node: Any) -> Values | None:
    """Values of a dataset as an array of its shape; None for a group."""
    return np.asarray(node[()]) if isinstance(node, h5py.Dataset) else None


def digest_of(node: Any, values: Values | None) -> str:
    """SHA-256 over attributes, type, shape and values of a group or dataset."""
    sha = hashlib.sha256()
    for key in sorted(set(node.attrs) - _LIBRARY_ATTRIBUTES):
        sha.update(json.dumps([key, _attribute(node.attrs[key])]).encode())
    if values is not None:
        sha.update(json.dumps([values.dtype.str, values.shape]).encode())
        if values.dtype == object:
            for value in values.ravel():
                sha.update(len(value).to_bytes(8, "little") + value)
        else:
            sha.update(np.ascontiguousarray(values).data)
    return sha.hexdigest()


def _attribute(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.decode("utf-8", "backslashreplace")
    return value.tolist() if hasattr(value, "tolist") else value

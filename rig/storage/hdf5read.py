"""Reading the HDF5 layout of `rig.storage.hdf5`, checked whole before anything is believed."""

from __future__ import annotations

import hashlib
import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from rig.dataset import ORIGINS, Dataset
from rig.errors import InputError
from rig.meta import Meta
from rig.storage.columns import Values
from rig.storage.hdf5 import MANIFEST, SAMPLES, SCHEMA_VERSION, content_of, digest_of
from rig.storage.seal import BROKEN, SCHEMA, check_bytes, damaged
from rig.yaml.yamlfile import load_yaml_text


def read_uuid(path: Path) -> str:
    """UUID of the file, "" if there is none or it cannot be read."""
    with suppress(InputError, *BROKEN):
        check_bytes(path)
        with h5py.File(path, "r") as file:
            return str(file.attrs["uuid"])
    return ""


def holds_import(path: Path) -> bool:
    """True for a data set that was imported from a table, and so can be made anew."""
    with suppress(InputError, *BROKEN):
        check_bytes(path)
        with h5py.File(path, "r") as file:
            return file.attrs["schema"] == SCHEMA and "entry/texts/comments" in file
    return False


def read_file(path: Path) -> Dataset:
    """The data set of an HDF5 file, checked whole. InputError for anything wrong."""
    check_bytes(path)
    try:
        with h5py.File(path, "r") as file:
            return _Reading(file, path).dataset()
    except BROKEN as error:
        words = _first_line(error)
        raise damaged(path, f"the HDF5 library says: {words}.") from error


def _first_line(error: BaseException) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__


class _Reading:
    """One pass over an open file."""

    def __init__(self, file: h5py.File, path: Path) -> None:
        self._file = file
        self._path = path
        self._rows = 0
        self._contents: dict[str, Values] = {}  # read once, for checksum and result

    def dataset(self) -> Dataset:
        root = dict(self._file.attrs)
        self._check_schema(root)
        self._rows = int(root["rows"])
        listed = self._verified()
        columns, units, long_names = self._columns(listed)
        texts = {n: self._text(f"entry/texts/{n}") for n in _below("entry/texts/", listed)}
        origin = str(root["origin"])
        if origin not in ORIGINS:
            raise damaged(self._path, f'its origin is "{origin}".')
        return Dataset(
            path=self._path,
            uuid=str(root["uuid"]),
            created=str(root["created"]),
            origin=origin,
            complete=bool(root["complete"]),
            meta=load_yaml_text(texts["meta"], f"{self._path}: entry/texts/meta", Meta),
            columns=columns,
            units=units,
            long_names=long_names,
            texts=texts,
            software=str(root["software"]),
            stop_reason=str(root["stop_reason"]),
            title=str(root["title"]).removeprefix("EMULATED: "),
            **{
                k: json.loads(self._text(f"entry/record/{k}"))
                for k in ("events", "devices", "calibration")
            },
        )

    def _check_schema(self, root: dict[str, Any]) -> None:
        if root.get("schema") != SCHEMA:
            raise InputError(
                f"{self._path}: an HDF5 file of another program (no schema = {SCHEMA} among its "
                "attributes). Bring its values in as a table with `rig import`."
            )
        stored = int(root["schema_version"])
        if stored > SCHEMA_VERSION:
            raise InputError(
                f"{self._path}: written by a newer version of this program (layout {stored}, "
                f"{root.get('software')}); this one reads layouts up to {SCHEMA_VERSION}. Update."
            )

    def _verified(self) -> dict[str, str]:
        """The manifest, after everything in it was compared with the file."""
        text = self._text(MANIFEST)
        digest = hashlib.sha256(text.encode()).hexdigest()
        if digest != str(self._file[MANIFEST].attrs["sha256"]):
            raise damaged(self._path, f"/{MANIFEST} has changed since it was written.")
        listed: dict[str, str] = json.loads(text)
        for name, expected in listed.items():
            if name != "/" and name not in self._file:
                raise damaged(self._path, f"/{name} is missing.")
            self._verify(name, expected)
        return listed

    def _verify(self, name: str, expected: str) -> None:
        node = self._file[name]
        place = name if name == "/" else f"/{name}"
        if name.startswith(f"{SAMPLES}/") and node.shape != (self._rows,):
            raise damaged(self._path, f"{place} has the shape {node.shape}, not ({self._rows},).")
        try:
            content = content_of(node)
        except BROKEN as error:
            raise damaged(self._path, f"{place} cannot be read: {_first_line(error)}.") from error
        if digest_of(node, content) != expected:
            raise damaged(self._path, f"{place} has changed since it was written.")
        if content is not None:
            self._contents[name] = content

    def _columns(
        self, listed: dict[str, str]
    ) -> tuple[dict[str, Values], dict[str, str], dict[str, str]]:
        nodes = [self._file[f"{SAMPLES}/{n}"] for n in _below(f"{SAMPLES}/", listed) if n != "time"]
        nodes.sort(key=lambda node: int(node.attrs["column_index"]))
        columns: dict[str, Values] = {}
        units, long_names = {}, {}
        for node in nodes:
            name = str(node.attrs.get("column_name", node.name.rsplit("/", 1)[1]))
            columns[name] = _values(node, self._contents[node.name.lstrip("/")])
            units[name] = str(node.attrs.get("units", ""))
            long_names[name] = str(node.attrs.get("long_name", ""))
        return columns, units, long_names

    def _text(self, name: str) -> str:
        node = self._file.get(name)
        if not isinstance(node, h5py.Dataset) or node.shape != ():
            raise damaged(self._path, f"/{name} is missing.")
        value = node[()]
        return value.decode("utf-8") if isinstance(value, bytes) else str(value)


def _below(prefix: str, listed: dict[str, str]) -> list[str]:
    return [name.removeprefix(prefix) for name in listed if name.startswith(prefix)]


def _values(node: h5py.Dataset, raw: Values) -> Values:
    if raw.dtype == object:
        return np.array([v.decode("utf-8") for v in raw], dtype=str)
    if raw.dtype.kind == "S":
        return _decoded(raw)
    return raw.astype(np.bool_) if node.attrs.get("kind") == "flag" else raw


def _decoded(raw: Values) -> Values:
    """Text of fixed-length UTF-8; pure ASCII goes the fast way."""
    if raw.size == 0 or raw.view(np.uint8).max() < 128:
        return raw.astype(f"U{max(1, raw.dtype.itemsize)}")
    return np.char.decode(raw, "utf-8")

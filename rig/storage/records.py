"""What a journal's records tell: columns, devices, events, how it ended."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from rig.errors import InputError
from rig.journal import Record
from rig.storage.columns import KNOWN, Values, empty, unit_of

_PLACE = ("time_s", "session_s", "pose", "direction", "repetition", "branch", "step")
_SLOT = ("target_N", "segment", "number", "lateness_s")
_DEVICE = {
    "count": ("valid single values in the sample", np.int64),
    "invalid": ("invalid single values in the sample", np.int64),
    "age_s": ("age of the newest single value", np.float64),
}


class Story:
    """Replayed records, gathered.

    Several descriptors are allowed (a resumed run writes another); the newest word counts. Samples
    may lack values that others have: nan there.
    """

    def __init__(self, records: Sequence[Record], name: str) -> None:
        """`name`: of the journal, for messages."""
        self._name = name
        if not records or records[0].kind != "start":
            raise InputError(f"{name}: the journal has no start record.")
        self.start = records[0].data
        self.devices: dict[str, dict[str, str]] = {}
        self.calibration: dict[str, Any] = {}
        self.events: list[dict[str, Any]] = []
        self.complete = False
        self.stop_reason = "it was cut off"
        self._signals: dict[str, tuple[str, str]] = {}
        self._samples: list[Mapping[str, Any]] = []
        self._discarded: list[tuple[int, int]] = []
        for record in records[1:]:
            try:
                self._add(record)
            except (KeyError, TypeError, ValueError, AttributeError) as error:
                raise InputError(
                    f"{name}:{record.number + 1}: the {record.kind} record lacks or garbles "
                    f"{error}. It was written by another program or version."
                ) from error

    def text(self, key: str) -> str:
        """Text of "protocol", "station" or "meta", verbatim."""
        value = self.start.get(key) or ""
        return value if isinstance(value, str) else json.dumps(value)  # JSON is YAML, too

    def _add(self, record: Record) -> None:
        data = record.data
        if record.kind == "sample":
            self._samples.append(data)
        elif record.kind == "descriptor":
            self._describe(data)
        elif record.kind == "event":
            self.events.append({"sample": len(self._samples), **data})
            if data["kind"] == "discard":
                self._discarded.append((int(data["first"]), int(data["last"])))
            elif data["kind"] == "stopped":
                self.stop_reason = str(data["text"])
        elif record.kind == "stop":
            self.complete = bool(data["complete"])
            self.stop_reason = str(data["reason"])
        # Whatever follows a stop belongs to a resumed run, which has not ended yet.
        if record.kind in ("sample", "descriptor"):
            self.complete, self.stop_reason = False, "it was cut off"

    def _describe(self, data: Mapping[str, Any]) -> None:
        for name, identity in data["devices"].items():
            self.devices[name] = {k: str(v) for k, v in identity.items()}
        for signal in data["signals"]:
            self._signals[signal["name"]] = (str(signal["unit"]), str(signal["long_name"]))
        self.calibration.update(data.get("calibration") or {})

    @cached_property
    def columns(self) -> dict[str, Values]:
        """All columns, shape (samples,) each."""
        try:
            result = dict(self._fixed_columns())
            for name in self._names("values"):
                result[name] = self._numbers("values", name)
            for name in self._names("sd"):
                result[f"{name}_errors"] = self._numbers("sd", name)
            for key, (_, dtype) in _DEVICE.items():
                for device in self._names(key):
                    result[f"{device}_{key}"] = self._numbers(key, device, dtype)
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise InputError(
                f"{self._name}: a sample record lacks or garbles {error}. "
                "It was written by another program or version."
            ) from error
        for name in ("force_N", "displacement_mm"):
            result.setdefault(name, empty("number", len(self._samples)))
        result["discarded"] = self._discards()
        return result

    def _fixed_columns(self) -> Iterator[tuple[str, Values]]:
        dtypes = {"number": np.float64, "count": np.int64, "word": np.str_}
        for name in (*_PLACE, *_SLOT):
            dtype = dtypes[KNOWN[name].kind]
            cells = [sample[name] for sample in self._samples]
            if dtype is np.float64:
                cells = [np.nan if c is None else c for c in cells]
            yield name, np.array(cells, dtype=dtype if cells or dtype is not np.str_ else "U1")

    def _names(self, key: str) -> list[str]:
        return list(dict.fromkeys(name for sample in self._samples for name in sample[key]))

    def _numbers(self, key: str, name: str, dtype: type = np.float64) -> Values:
        missing = 0 if dtype is np.int64 else np.nan
        cells = [sample[key].get(name) for sample in self._samples]
        return np.array([missing if c is None else c for c in cells], dtype=dtype)

    def _discards(self) -> Values:
        rows = len(self._samples)
        discarded = empty("flag", rows)
        for first, last in self._discarded:
            if not 0 <= first <= last < rows:
                raise InputError(
                    f"{self._name}: an event discards the samples {first} to {last}, "
                    f"but there are {rows}."
                )
            discarded[first : last + 1] = True
        return discarded

    @property
    def units(self) -> dict[str, str]:
        """Unit of every column, "" for none."""
        return {name: self._described(name)[0] for name in self.columns}

    @property
    def long_names(self) -> dict[str, str]:
        """What every column means, in words."""
        return {name: self._described(name)[1] for name in self.columns}

    def _described(self, name: str) -> tuple[str, str]:
        if name in KNOWN:
            return KNOWN[name].unit, KNOWN[name].long_name
        if name in self._signals:
            return self._signals[name]
        if name.endswith("_errors"):
            unit, long_name = self._described(name.removesuffix("_errors"))
            return unit, f"{long_name}, standard deviation of the single values"
        for key, (words, _) in _DEVICE.items():
            if name.endswith(f"_{key}"):
                return unit_of(name), f"{name.removesuffix(f'_{key}')}: {words}"
        return unit_of(name), name.replace("_", " ")

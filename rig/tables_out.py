"""Tables of measurements: giving data sets out as CSV or Parquet."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rig import schemas
from rig.dataset import Dataset
from rig.errors import InputError
from rig.storage.columns import NO_STEP, TABLE_COLUMNS
from rig.storage.files import in_place_of
from rig.terminal import Progress, silent

if TYPE_CHECKING:
    import pandas as pd

_EXPORT_ROWS = 50_000


def export_table(dataset: Dataset, out: Path, progress: Progress | None = None) -> None:
    """Writes .csv (comment lines, then one row a sample, all columns) or .parquet.

    What `import_table` reads back gives the same samples, bit for bit. InputError for another
    ending, a missing library, or a folder that refuses.
    """
    progress = progress or silent
    if out.suffix == ".csv":
        with in_place_of(out) as temporary:
            _write_csv(dataset, temporary, progress)
    elif out.suffix == ".parquet":
        _write_parquet(dataset, out)
    else:
        raise InputError(f'{out}: the ending "{out.suffix}" is not known; allowed: .csv, .parquet.')


def _frame(dataset: Dataset) -> pd.DataFrame:
    import pandas as pd

    names = [n for n in TABLE_COLUMNS if n in dataset.columns]
    names += [n for n in dataset.columns if n not in names]
    if dataset.meta.robot == "none":
        names.remove("pose")
    columns = {n: dataset.columns[n] for n in names}
    if not columns["discarded"].any():
        del columns["discarded"]
    else:
        columns["discarded"] = columns["discarded"].astype(np.int8)
    return pd.DataFrame(columns)


def _header_lines(dataset: Dataset) -> list[str]:
    facts = {
        "data set": dataset.uuid,
        "title": dataset.title,
        "created": dataset.created,
        "origin": dataset.origin,
        "software": dataset.software,
    }
    lines = [*dataset.banners(), schemas.TABLE, *(f"{k}: {v}" for k, v in facts.items() if v)]
    return ["# " + line.replace("\r", " ").replace("\n", " ") for line in lines]


def _write_csv(dataset: Dataset, path: Path, progress: Progress) -> None:
    frame = _frame(dataset)
    frame["step"] = frame["step"].astype("Int64").mask(frame["step"] == NO_STEP)
    with path.open("w", encoding="utf-8", newline="") as file:
        file.writelines(line + "\n" for line in _header_lines(dataset))
        for first in range(0, max(1, len(frame)), _EXPORT_ROWS):
            part = frame.iloc[first : first + _EXPORT_ROWS]
            part.to_csv(file, index=False, header=first == 0, lineterminator="\n")
            progress("writing", min(1.0, (first + _EXPORT_ROWS) / max(1, len(frame))))


def _write_parquet(dataset: Dataset, out: Path) -> None:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise InputError(
            f"{out}: Parquet needs the library pyarrow, which is not installed. Install it with "
            "`pip install pyarrow`, or write CSV, which needs nothing."
        ) from None
    table = pa.Table.from_pandas(_frame(dataset), preserve_index=False)
    facts = {
        "schema": schemas.TABLE,
        "uuid": dataset.uuid,
        "created": dataset.created,
        "origin": dataset.origin,
        "complete": str(dataset.complete).lower(),
        "title": dataset.title,
        "software": dataset.software,
        "banner": "\n".join(dataset.banners()),
        **dataset.texts,
    }
    old = table.schema.metadata or {}
    new = {f"rig.{k}".encode(): v.encode() for k, v in facts.items()}
    fields = [
        field.with_metadata({b"units": dataset.units.get(field.name, "").encode()})
        for field in table.schema
    ]
    table = table.cast(pa.schema(fields, metadata=old | new))
    with in_place_of(out) as temporary:
        pq.write_table(table, temporary, compression="zstd")

"""One small recording, written in every format that is read."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from csv_signals import MAPPING, SIGNALS, TIME, write_csv


def write_mat5(path: Path) -> None:
    from scipy.io import savemat

    extra = {"note": "text", "cell": np.array([1, "a"], dtype=object), "empty": np.zeros((0, 0))}
    savemat(path, {**{k: v[:, None] for k, v in SIGNALS.items()}, **extra})


def write_mat73(path: Path) -> None:
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in SIGNALS.items():
            file.create_dataset(name, data=values[None, :]).attrs["MATLAB_class"] = np.bytes_(
                "double"
            )
        text = file.create_dataset("note", data=np.array([[116], [120]], dtype=np.uint16))
        text.attrs["MATLAB_class"] = np.bytes_("char")
        empty = file.create_dataset("empty", data=np.zeros(2, dtype=np.uint64))
        empty.attrs["MATLAB_empty"] = np.uint8(1)
        file.create_group("#refs#")["a"] = np.arange(3.0)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(512, b" "))


def write_hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        for name, values in SIGNALS.items():
            file[name] = values
        file["note"] = "text"


def write_npz(path: Path) -> None:
    np.savez(path, **SIGNALS, note=np.array(["text"]), thing=np.array([None]))


def write_tdms(path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as file:
        file.write_segment([nptdms.ChannelObject("", k, v) for k, v in SIGNALS.items()])


def write_xlsx(path: Path) -> None:
    book = pytest.importorskip("openpyxl").Workbook()
    for row in (["of", "Monday", None], list(SIGNALS), *zip(*SIGNALS.values(), strict=True)):
        book.active.append(list(row))
    book.save(path)


def structs(*fields: dict[str, Any]) -> np.ndarray:
    """An array of structures, as savemat takes it."""
    array = np.empty((1, len(fields)), dtype=[(name, object) for name in fields[0]])
    for i, one in enumerate(fields):
        array[0, i] = tuple(one.values())
    return array


def write_dspace(path: Path) -> None:
    from scipy.io import savemat

    named = [{"Name": k, "Data": SIGNALS[k][None, :], "Raster": "HostService"} for k in "uq"]
    savemat(path, {"rec": {"X": structs({"Data": TIME[None, :]}), "Y": structs(*named)}})


def write_dspace73(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        refs = file.create_group("#refs#")
        x, y = file.create_group("rec/X"), file.create_group("rec/Y")
        x["Data"] = TIME[:, None]
        y["Data"] = np.empty((2, 1), dtype=h5py.ref_dtype)
        y["Name"] = np.empty((2, 1), dtype=h5py.ref_dtype)
        for i, name in enumerate("uq"):
            refs[f"d{i}"], refs[f"n{i}"] = SIGNALS[name][:, None], [[np.uint16(ord(name))]]
            refs[f"n{i}"].attrs["MATLAB_class"] = np.bytes_("char")
            y["Data"][i, 0], y["Name"][i, 0] = refs[f"d{i}"].ref, refs[f"n{i}"].ref


def write_struct_with_time(path: Path) -> None:
    from scipy.io import savemat

    signals = [{"values": SIGNALS[k][:, None], "dimensions": 1, "label": k} for k in "uq"]
    savemat(path, {"simout": {"time": TIME[:, None], "signals": structs(*signals)}})


def time_series(name: str, even: bool) -> Any:
    matclass = pytest.importorskip("matio.utils.matclass")
    clock = {"Start_": np.zeros((1, 1)), "Increment_": np.full((1, 1), 1e-3)}
    info = matclass.MatlabOpaque(clock if even else {}, "tsdata.timemetadata")
    properties = {"Name": name, "Data_": SIGNALS[name].reshape(1, 1, -1), "TimeInfo": info}
    times = np.zeros((0, 1)) if even else TIME[:, None]
    return matclass.MatlabOpaque(properties | {"Time_": times}, "timeseries")


def write_time_series(path: Path, version: str = "v7.3") -> None:
    matio = pytest.importorskip("matio")
    series = {"ts_u": time_series("u", even=False), "ts_q": time_series("q", even=True)}
    matio.save_to_mat(str(path), series, version=version)


def write_dataset(path: Path) -> None:
    matclass = pytest.importorskip("matio.utils.matclass")
    elements = np.empty((2, 1), dtype=object)
    for i, name in enumerate("uq"):
        values = {"Name": name, "Values": time_series(name, even=False)}
        elements[i, 0] = matclass.MatlabOpaque(values, "Simulink.SimulationData.Signal")
    store = matclass.MatlabOpaque({"Elements": elements}, "Simulink.SimulationData.Storage.Ram")
    data = matclass.MatlabOpaque({"Storage_": store}, "Simulink.SimulationData.Dataset")
    pytest.importorskip("matio").save_to_mat(str(path), {"logsout": data}, version="v7")


# A new reader is tested by adding its file name and a writer here, and the mapping where the names
# are not t, u and q.
WRITERS: dict[str, Callable[[Path], None]] = {
    "a.csv": write_csv,
    "a.mat": write_mat5,
    "b.mat": write_mat73,
    "a.h5": write_hdf5,
    "a.npz": write_npz,
    "a.tdms": write_tdms,
    "a.xlsx": write_xlsx,
    "dspace.mat": write_dspace,
    "dspace73.mat": write_dspace73,
    "struct.mat": write_struct_with_time,
    "series.mat": partial(write_time_series, version="v7"),
    "series73.mat": write_time_series,
    "dataset.mat": write_dataset,
}
MAPPINGS = {
    "a.tdms": "time=/t,force=/u,position=/q",
    "dspace.mat": "time=rec.X.Data,force=rec.Y(1).Data,position=q",
    "dspace73.mat": "time=rec.X.Data,force=u,position=rec.Y(2).Data",
    "struct.mat": "time=simout.time,force=simout.signals(1).values,position=q",
    "series.mat": "time=q.Time,force=ts_u.Data,position=q",
    "series73.mat": "time=ts_u.Time,force=u,position=ts_q.Data",
    "dataset.mat": "time=u.Time,force=u,position=q",
}


def mapping_of(name: str) -> str:
    return MAPPINGS.get(name, MAPPING)

"""Write one trajectory in every format of logs, with the libraries that people use.

Arguments: a CSV file with the columns time, q1, q2, qd1, qd2, tau1, tau2, and the folder to write into.
"""

import collections
import csv
import gzip
import io
import json
import os
import pathlib
import pickle
import sys
import types
import zipfile

import h5py
import numpy
import pyarrow
import pyarrow.parquet
import scipy.io

source, folder = (pathlib.Path(argument) for argument in sys.argv[1:])
with open(source, newline="") as file:
    names, *rows = list(csv.reader(file))
table = numpy.array(rows, dtype=float)
channels = {"time": table[:, 0], "q": table[:, 1:3], "qd": table[:, 3:5], "tau": table[:, 5:7]}

with gzip.open(folder / "packed.csv.gz", "wb") as file:
    file.write(source.read_bytes())
with open(folder / "german.csv", "w", newline="") as file:
    writer = csv.writer(file, delimiter=";")
    writer.writerows([names, *([cell.replace(".", ",") for cell in row] for row in rows)])
with open(folder / "tabs.tsv", "w", newline="") as file:
    csv.writer(file, delimiter="\t").writerows([names, *rows])
numpy.savez(folder / "matrices.npz", **channels, robot=numpy.array(["left", "arm"]), gains=numpy.zeros((2, 2, 2)), rate=250)
numpy.savez_compressed(folder / "columns.npz", **{name: table[:, k] for k, name in enumerate(names)})
numpy.savez(folder / "fortran.npz", **{name: numpy.asfortranarray(values) for name, values in channels.items()})
ticks = {**channels, "time": numpy.arange(len(table)), "q": numpy.round(1000 * channels["q"]).astype(numpy.int32)}
numpy.savez(folder / "integers.npz", **ticks)
numpy.savez(folder / "short.npz", **{**channels, "tau": channels["tau"][:-3]})
gap = channels["q"].copy()
gap[4, 1] = numpy.nan
numpy.savez(folder / "gap.npz", **{**channels, "q": gap})

# MATLAB has no vectors, but matrices of one column or one row; it writes other things beside.
beside = {"note": "left arm", "rig": {"joints": 2}, "cells": numpy.array([1, "a"], dtype=object), "gains": numpy.zeros((2, 2, 2))}
for name, packed in [("plain.mat", False), ("packed.mat", True)]:
    scipy.io.savemat(folder / name, {**channels, **beside}, do_compression=packed)
scipy.io.savemat(folder / "columns.mat", {name: table[:, [k]] for k, name in enumerate(names)})
scipy.io.savemat(folder / "integers.mat", ticks)
scipy.io.savemat(folder / "gap.mat", {**channels, "q": gap})



def hdf5(name, arrays, chunked=None, **attributes):
    """Arrays by their paths, with attributes of the file."""
    with h5py.File(folder / name, "w") as file:
        file.attrs.update(attributes)
        for path, values in arrays.items():
            file.create_dataset(path, data=values, **(chunked or {}))


beside = {"camera": numpy.zeros((len(table), 4, 4, 3), dtype=numpy.uint8), "frames": numpy.zeros((len(table), 5000), dtype=numpy.uint8), "note": "left arm"}
hdf5("plain.h5", {**channels, **beside})
hdf5("chunked.h5", {f"run/{name}": values for name, values in channels.items()}, {"chunks": True, "compression": "gzip", "shuffle": True, "fletcher32": True})
hdf5("big_endian.h5", {name: values.astype(">f8") for name, values in channels.items()})
with h5py.File(folder / "latest.h5", "w", libver="latest") as file:
    for name, values in channels.items():
        file.create_dataset(name, data=values, chunks=(7,) + values.shape[1:], maxshape=(None,) + values.shape[1:])
    file["loop"] = file["/"]
hdf5("integers.h5", ticks)
hdf5("gap.h5", {**channels, "q": gap})
# As recorders of demonstrations keep them: groups of runs, and joints in their own order.
turned = {"time": table[:, 0], "observations/qpos": table[:, 2:0:-1], "observations/qvel": table[:, 4:2:-1], "action": table[:, 6:4:-1]}
hdf5("episode.hdf5", turned, joint_names=["wrist", "elbow"])
hdf5("named.hdf5", {**turned, "joint_names": ["wrist", "elbow"]})
hdf5("demos.hdf5", {f"data/demo_{k}/{name}": values for k in range(5) for name, values in turned.items()})
# What is known of the whole run, and torques on a clock of their own: every third row, from the third on.
slow = {"tau": channels["tau"][2::3], "tau_time": table[2::3, 0]}
numpy.savez(folder / "values.npz", **channels, kp=40, gain=numpy.array([0.5]))
numpy.savez(folder / "clocks.npz", **{**channels, **slow})
hdf5("values.h5", channels, kp=40.0, gain=0.5, site="lab")
hdf5("clocks.h5", {**channels, **slow})
with h5py.File(folder / "seven.mat", "w", userblock_size=512) as file:
    for name, values in {**channels, "note": numpy.array([[ord(letter)] for letter in "left"], dtype=numpy.uint16), "none": numpy.zeros(2, dtype=numpy.uint64)}.items():
        array = file.create_dataset(f"rig/{name}" if name == "q" else name, data=numpy.atleast_2d(values.T))
        array.attrs["MATLAB_class"] = numpy.bytes_("char" if name == "note" else "double")
        if name == "none":
            array.attrs["MATLAB_empty"] = numpy.uint8(1)
with open(folder / "seven.mat", "r+b") as file:
    file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")

columns = {name: table[:, k] for k, name in enumerate(names)}
for packing in ["snappy", "gzip", "zstd", "lz4", "none"]:
    pyarrow.parquet.write_table(pyarrow.table(columns), folder / f"{packing}.parquet", compression=packing, row_group_size=20)
lists = {name: list(values) for name, values in channels.items()}
pyarrow.parquet.write_table(pyarrow.table({**lists, "mode": ["run"] * len(table)}), folder / "lists.parquet")
pyarrow.parquet.write_table(pyarrow.table({**columns, "q2": [*gap[:, 1]]}), folder / "gap.parquet")
ragged = [*channels["q"][:-1], channels["q"][-1][:1]]
pyarrow.parquet.write_table(pyarrow.table({**lists, "q": ragged}), folder / "ragged.parquet")


def episode(number, rows):
    """The frames of an episode as LeRobot writes them: single precision."""
    count = len(rows)
    single = {
        "observation.state": list(rows[:, 1:3].astype(numpy.float32)),
        "action": list(rows[:, 5:7].astype(numpy.float32)),
        "timestamp": rows[:, 0].astype(numpy.float32),
    }
    return pyarrow.table({**single, "frame_index": range(count), "episode_index": [number] * count})


def lerobot(name, version, files):
    """A data set: its description, and episodes by file."""
    feature = {"dtype": "float32", "shape": [2]}
    joints = ["elbow.pos", "wrist.pos"]
    features = {"observation.state": {**feature, "names": joints}, "action": {**feature, "names": {"motors": joints}}}
    (folder / name / "meta").mkdir(parents=True)
    (folder / name / "meta/info.json").write_text(json.dumps({"codebase_version": version, "fps": 250, "features": features}))
    (folder / name / "data/chunk-000").mkdir(parents=True)
    for file, episodes in files.items():
        pyarrow.parquet.write_table(pyarrow.concat_tables(episodes), folder / name / "data/chunk-000" / file)


first, second = episode(0, table), episode(1, table[:30])
lerobot("set_v2", "v2.1", {"episode_000000.parquet": [first], "episode_000001.parquet": [second]})
lerobot("set_v3", "v3.0", {"file-000.parquet": [first, second]})
lerobot("single", "v3.0", {"file-000.parquet": [first]})


class Tensor:
    """A tensor as PyTorch pickles it: a view of a storage, with sizes and strides in elements."""

    STORAGES = {"float32": "FloatStorage", "float64": "DoubleStorage", "int64": "LongStorage"}

    def __init__(self, values):
        self.values = values
        self.storage = values if values.base is None else values.base

    def __reduce_ex__(self, protocol):
        size = self.values.itemsize
        stride = tuple(step // size for step in self.values.strides)
        offset = (self.values.ctypes.data - self.storage.ctypes.data) // size
        arguments = (self.storage, offset, self.values.shape, stride, False, collections.OrderedDict())
        return sys.modules["torch._utils"]._rebuild_tensor_v2, arguments


def torch_save(path, entries):
    """What `torch.save` writes (torch/serialization.py, `_save`): a pickle of protocol 2 whose storages are files of their own."""
    for module, names in {"torch": Tensor.STORAGES.values(), "torch._utils": ["_rebuild_tensor_v2"]}.items():
        sys.modules[module] = types.ModuleType(module)
        for name in names:
            setattr(sys.modules[module], name, type(name, (), {"__module__": module}))
    storages, pickled = [], io.BytesIO()

    class Pickler(pickle.Pickler):
        def persistent_id(self, object):
            if not isinstance(object, numpy.ndarray):
                return None
            known = [k for k, storage in enumerate(storages) if storage is object]
            key = known[0] if known else len(storages)
            storages[key:] = [object] if not known else storages[key:]
            kind = getattr(sys.modules["torch"], Tensor.STORAGES[object.dtype.name])
            return "storage", kind, str(key), "cpu", object.size

    Pickler(pickled, protocol=2).dump({name: Tensor(value) if isinstance(value, numpy.ndarray) else value for name, value in entries.items()})
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("run/data.pkl", pickled.getvalue())
        archive.writestr("run/.format_version", "1")
        archive.writestr("run/byteorder", "little")
        for key, storage in enumerate(storages):
            archive.writestr(f"run/data/{key}", storage.tobytes(order="A"))
        archive.writestr("run/version", "3\n")


torch_save(folder / "double.pt", channels)
names = ["elbow", "wrist"]
# As PACE keeps them: positions and targets in single precision, here by columns and as a view of a wider tensor.
wide = numpy.zeros((len(table), 4), dtype=numpy.float32)
wide[:, 1:3] = table[:, 5:7]
pace = {"time": table[:, 0].astype(numpy.float32), "dof_pos": numpy.asfortranarray(table[:, 1:3].astype(numpy.float32)), "des_dof_pos": wide[:, 1:3]}
torch_save(folder / "pace.pt", pace)
torch_save(folder / "values.pt", {**channels, "kp": 40, "gain": 0.5, "site": "lab"})
torch_save(folder / "clocks.pt", {"time": table[:, 0].copy(), "dof_pos": table[:, 1:3], "dof_vel": table[:, 3:5], "torques": slow["tau"], "torques_time": slow["tau_time"]})
torch_save(folder / "named.pt", {**pace, "joint_names": names, "kp": numpy.full(2, 20.0)})
torch_save(folder / "ticks.pt", {**pace, "time": numpy.arange(len(table))})
torch_save(folder / "legged.pt", {"time": table[:, 0].copy(), "dof_pos": table[:, 1:3], "dof_vel": table[:, 3:5], "torques": table[:, 5:7], "des_dof_vel": wide})
torch_save(folder / "robots.pt", {**pace, "dof_pos": numpy.zeros((3, len(table), 2))})
torch_save(folder / "wrong_names.pt", {**pace, "joint_names": ["elbow"]})
torch_save(folder / "numpy.pt", {**pace, "dt": numpy.float64(0.004)})
torch_save(folder / "object.pt", {**pace, "config": pathlib.PurePosixPath("run")})


class Command:
    """What a hostile file holds: a call."""

    def __reduce__(self):
        return os.system, (f"touch {folder / 'executed'}",)


torch_save(folder / "hostile.pt", {**pace, "config": Command()})
numpy.savez(folder / "pickled.npz", **{**channels, "q": numpy.array([{"q": 1}] * len(table), dtype=object)})

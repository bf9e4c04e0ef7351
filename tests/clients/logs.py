"""Write one trajectory in every format of logs, with the libraries that people use.

Arguments: a CSV file with the columns time, q1, q2, qd1, qd2, tau1, tau2, and the folder to write into.
"""

import csv
import gzip
import pathlib
import sys

import numpy

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
numpy.savez(folder / "pickled.npz", **{**channels, "q": numpy.array([{"q": 1}] * len(table), dtype=object)})

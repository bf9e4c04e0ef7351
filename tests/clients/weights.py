"""Load a checkpoint with the safetensors package: names, types and shapes of all tensors, and their values."""

import json
import pathlib
import sys

import numpy
from safetensors.numpy import load_file

folder = pathlib.Path(sys.argv[1])
report = json.loads((folder / "report.json").read_text())
checkpoint = folder / report["files"]["checkpoint"]
manifest = json.loads((checkpoint / "checkpoint.json").read_text())
tensors = load_file(checkpoint / "weights.safetensors")

widths = manifest["residual"]["widths"]
expected = {f"parameters.{p['name']}": ((1,), "float64") for p in manifest["parameters"]}
for k, (inputs, outputs) in enumerate(zip(widths, widths[1:])):
    expected[f"layers.{k}.weight"] = ((outputs, inputs), "float32")
    expected[f"layers.{k}.bias"] = ((outputs,), "float32")
found = {name: (tensor.shape, tensor.dtype.name) for name, tensor in tensors.items()}
assert found == expected, f"found {found}, expected {expected}"
assert len(widths) >= 3, f"a network without a hidden layer: {widths}"

for name, tensor in tensors.items():
    assert numpy.isfinite(tensor).all(), f"{name} holds a number that is not finite"

fitted = report["parameters"] + [p for effect in report["effects"] for p in effect["parameters"]]
for parameter in fitted:
    stored, reported = tensors[f"parameters.{parameter['name']}"][0], parameter["value"]
    assert abs(stored - reported) <= 1e-6 * max(1.0, abs(reported)), f"{parameter['name']}: {stored}, {reported}"

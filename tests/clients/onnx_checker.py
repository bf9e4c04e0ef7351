"""Check both graphs of an exported ONNX model with onnx's own checker, and what its metadata says."""

import json
import pathlib
import sys

import onnx

path, expected = pathlib.Path(sys.argv[1]), json.loads(pathlib.Path(sys.argv[2]).read_text())
for file in (path, path.with_name(f"{path.stem}-derivative.onnx")):
    model = onnx.load(file)
    onnx.checker.check_model(model, full_check=True)
    metadata = {p.key: p.value for p in model.metadata_props}
    assert metadata["system"] == expected["system"], metadata
    assert float(metadata["dt"]) == expected["step_s"], metadata
    parameters = [[p["name"], p["value"], p["unit"]] for p in json.loads(metadata["parameters"])]
    assert parameters == expected["parameters"], parameters
    batch = model.graph.input[0].type.tensor_type.shape.dim[0]
    assert batch.dim_param == "batch", batch

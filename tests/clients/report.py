"""Read a report as any program would: JSON, checked against the schema, and the files that it names."""

import datetime
import hashlib
import json
import pathlib
import sys

import jsonschema


def refuse(constant):
    raise ValueError(f"{constant} is no JSON number")


folder, schema_path = map(pathlib.Path, sys.argv[1:])
report = json.loads((folder / "report.json").read_text(), parse_constant=refuse)
schema = json.loads(schema_path.read_text())
validator = jsonschema.validators.validator_for(schema)
validator.check_schema(schema)
faults = [f"{fault.json_path}: {fault.message}" for fault in validator(schema).iter_errors(report)]
assert not faults, "\n".join(faults)

call = report["call"]
assert call["command"].startswith("residyn closeloop ") and call["took_s"] > 0, call
began = datetime.datetime.fromisoformat(call["began"].replace("Z", "+00:00"))
assert datetime.timedelta(0) <= datetime.datetime.now(datetime.timezone.utc) - began < datetime.timedelta(hours=1), began
for file in call["inputs"]:
    # Paths are relative to the folder in which the command ran, here the report's parent.
    assert hashlib.sha256((folder.parent / file["path"]).read_bytes()).hexdigest() == file["sha256"], file["path"]

horizons, joints = len(report["error"]["horizons_s"]), report["joints"]
named = {name: report["error"][name] or {} for name in ("declared", "before", "after", "hybrid")}
for name, error in [*named.items(), *((other["name"], other) for other in report["error"]["against"])]:
    for measure in ("position_rmse", "position_median", "velocity_rmse"):
        rows = error.get(measure)
        if rows is not None:
            assert [len(row) for row in rows] == [joints] * horizons, f"shape of {measure} of {name}"

for name in ("model", "report", "checkpoint"):
    file = report["files"][name]
    assert file is None or (folder / file).exists(), f"files.{name} names {file}, which is not there"
for plot in report["files"].get("plots", []):
    assert (folder / plot).exists(), f"files.plots names {plot}, which is not there"

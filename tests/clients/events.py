"""Read an event file as TensorBoard does: tags, steps, wall times and values of its scalars.

A wall time of null may be any; a third argument names the one tag to look at.
"""

import json
import pathlib
import sys

from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

folder, expected_path, *only = sys.argv[1:]
events = EventAccumulator(folder)
events.Reload()
assert events.file_version == 2.0, f"file version {events.file_version}"

expected = {}
for tag, step, wall_time, value in json.loads(pathlib.Path(expected_path).read_text()):
    expected.setdefault(tag, []).append((step, wall_time, value))
tags = only or events.Tags()["scalars"]
assert sorted(tags) == sorted(expected), f"tags {tags}"
for tag, points in expected.items():
    found = [(event.step, event.wall_time, event.value) for event in events.Scalars(tag)]
    times = [read[1] if written[1] is None else written[1] for read, written in zip(found, points)]
    steps_and_times = [(point[0], time) for point, time in zip(points, times)]
    assert [point[:2] for point in found] == steps_and_times, f"{tag}: {found}, expected {points}"
    for (*_, read), (*_, written) in zip(found, points):
        assert abs(read - written) <= 1e-7 * abs(written), f"{tag}: {read}, expected {written}"

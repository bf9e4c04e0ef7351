"""An exported FMU in a simulator: python simulator.py MODEL.fmu CASE.json fails unless it behaves as the case says."""

import json
import pathlib
import sys

import fmpy
import numpy as np

path, case = sys.argv[1], json.loads(pathlib.Path(sys.argv[2]).read_text())
samples, step = case["samples"], case["samples"]["step_s"]
description = fmpy.read_model_description(path)
folder = fmpy.extract(path)
variables = {variable.name: variable for variable in description.modelVariables}
joints = [f"joint[{k + 1}]" for k in range(samples["joints"])]
state_names = [f"{joint}.{what}" for what in ("position", "velocity") for joint in joints]
torque_names = [f"{joint}.force" if f"{joint}.force" in variables else f"{joint}.torque" for joint in joints]
states, torques = ([variables[name].valueReference for name in names] for names in (state_names, torque_names))
held, start = np.array(samples["held"]), dict(zip(state_names, samples["start"]))


def near(mine, theirs, tolerance, what):
    mine, theirs = np.array(mine), np.array(theirs)
    assert mine.shape == theirs.shape, (what, mine.shape, theirs.shape)
    off = np.max(np.abs(mine - theirs) / np.maximum(1, np.max(np.abs(theirs), axis=0)))
    print(f"{what}: {off:.1e}")
    assert off <= tolerance, (what, off)


fmi2 = description.fmiVersion == "2.0"


def read(fmu, references):
    return list((fmu.getReal if fmi2 else fmu.getFloat64)(references))


def write(fmu, references, values):
    (fmu.setReal if fmi2 else fmu.setFloat64)(references, values)


def begin(fmu):
    fmu.reset()
    write(fmu, states, samples["start"])
    if fmi2:
        fmu.setupExperiment(startTime=0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()


def run(fmu, first, last, of=1):
    """Co-simulation over steps of the samples, `of` at a time, with the torque that the first of them has."""
    rows = []
    for k in range(first, last, of):
        write(fmu, torques, held[k])
        fmu.doStep(k * step, of * step)
        rows.append(read(fmu, states))
    return rows


slave = fmpy.instantiate_fmu(folder, description, "CoSimulation")
begin(slave)
plain = run(slave, 0, len(held))

# Another value of a parameter, from the start and from the middle on.
parameter = variables[case["parameter"]]
assert (parameter.causality, parameter.variability) == ("parameter", "tunable")
assert float(parameter.start) == case["value"] and parameter.unit == case["unit"], (parameter.start, parameter.unit)
begin(slave)
write(slave, [parameter.valueReference], [case["other_value"]])
near(run(slave, 0, len(held)), case["other_rollout"], 1e-9, "another value")
half = len(held) // 2
begin(slave)
before = run(slave, 0, half)
write(slave, [parameter.valueReference], [case["other_value"]])
after = run(slave, half, len(held))
near(before, plain[:half], 0, "until it is tuned")
assert np.max(np.abs(np.array(after) - np.array(plain[half:]))) > 1e-4, "tuning does nothing"

# A state that is kept, also as bytes, comes back.
begin(slave)
run(slave, 0, half)
kept = slave.getFMUState()
first = run(slave, half, half + 20)
slave.setFMUState(kept)
near(run(slave, half, half + 20), first, 0, "a kept state")
kept = slave.deserializeFMUState(slave.serializeFMUState(kept))
slave.setFMUState(kept)
near(run(slave, half, half + 20), first, 0, "a serialised state")
slave.freeFMUState(kept)

# Five steps in one: samples hold torques for five steps.
whole = len(held) // 5 * 5
begin(slave)
near(run(slave, 0, whole, of=5), plain[4:whole:5], 1e-9, "longer steps")
slave.terminate()
slave.freeInstance()

# Model exchange with a solver of its own, beside steps of the model.
time = np.repeat(np.arange(len(held) + 1) * step, 2)[1:-1]
signal = np.repeat(held, 2, axis=0)
dtype = [("time", float)] + [(name, float) for name in torque_names]
inputs = np.array([(t, *row) for t, row in zip(time, signal)], dtype)
result = fmpy.simulate_fmu(
    path, fmi_type="ModelExchange", stop_time=len(held) * step, output_interval=step, start_values=start, input=inputs,
    output=state_names, relative_tolerance=1e-8, solver="CVode",
)
result = result[np.searchsorted(result["time"], np.arange(1, len(held) + 1) * step - 1e-9)]
near(np.stack([result[name] for name in state_names], axis=1), plain, case["solver_tolerance"], "model exchange")

# Directional derivatives, and the transpose that FMI 3.0 has, beside central differences.
model = fmpy.instantiate_fmu(folder, description, "ModelExchange")
begin(model)
model.newDiscreteStates() if fmi2 else model.updateDiscreteStates()
model.enterContinuousTimeMode()
# Once with the last accepted point long ago, in sight of a delay, and then beyond it.
model.setTime(10.0)
knowns = [unknown.variable.derivative.valueReference for unknown in description.derivatives] + torques
unknowns = [unknown.variable.valueReference for unknown in description.derivatives]
generator, nudge = np.random.default_rng(1), 1e-6
for k, (state, torque) in enumerate(zip(samples["states"][:32], samples["torques"])):
    if k == 16:
        model.completedIntegratorStep()
        model.setTime(10.001)
    lagged = list(generator.uniform(-1, 1, len(knowns) - len(state) - len(torque)))
    at, seed = np.array(state + lagged + torque), generator.uniform(-1, 1, len(knowns))

    def rates(point):
        write(model, knowns, point)
        return np.array(read(model, unknowns))

    slope = (rates(at + nudge * seed) - rates(at - nudge * seed)) / (2 * nudge)
    rates(at)
    directional = np.array(model.getDirectionalDerivative(unknowns, knowns, seed))
    assert np.all(np.abs(directional - slope) <= 1e-5 * (1 + np.abs(slope))), (directional, slope)
    if fmi2:
        continue
    other = generator.uniform(-1, 1, len(unknowns))
    adjoint = np.array(model.getAdjointDerivative(unknowns, knowns, other, len(knowns)))
    assert np.isclose(other @ directional, adjoint @ seed, rtol=1e-9, atol=1e-9)
model.terminate()
model.freeInstance()

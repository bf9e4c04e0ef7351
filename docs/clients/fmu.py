"""Run an exported FMU of FMI 2.0 or 3.0: python fmu.py MODEL.fmu SAMPLES.json prints what it predicts at the samples."""

import json
import pathlib
import shutil
import sys

import fmpy
from fmpy.validation import validate_fmu

path, samples = sys.argv[1], json.loads(pathlib.Path(sys.argv[2]).read_text())
if problems := validate_fmu(path):
    sys.exit("\n".join(problems))
description = fmpy.read_model_description(path)
folder = fmpy.extract(path)
reference = {variable.name: variable.valueReference for variable in description.modelVariables}
joints = [f"joint[{k + 1}]" for k in range(samples["joints"])]
# Positions, velocities, then the states of effects.
states = [output.variable.valueReference for output in description.outputs]
rate_of = {rate.variable.derivative.valueReference: rate.variable.valueReference for rate in description.derivatives}
rates = [rate_of[state] for state in states]
kinds = ("torque", "force", "command")
torques = [next(reference[v] for v in (f"{joint}.{k}" for k in kinds) if v in reference) for joint in joints]


fmi2 = description.fmiVersion == "2.0"


def read(fmu, references):
    return list((fmu.getReal if fmi2 else fmu.getFloat64)(references))


def write(fmu, references, values):
    (fmu.setReal if fmi2 else fmu.setFloat64)(references, values)


def start(fmu, state):
    write(fmu, states, state)
    if fmi2:
        fmu.setupExperiment(startTime=0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()


def rollout(fmu, state, held):
    """The state after each step of co-simulation."""
    fmu.reset()
    start(fmu, state)
    for k, torque in enumerate(held):
        write(fmu, torques, torque)
        fmu.doStep(k * samples["step_s"], samples["step_s"])
        yield read(fmu, states)


def derivatives(fmu):
    """The derivative in model exchange."""
    start(fmu, samples["start"])
    fmu.newDiscreteStates() if fmi2 else fmu.updateDiscreteStates()
    fmu.enterContinuousTimeMode()
    for state, torque in zip(samples["states"], samples["torques"]):
        write(fmu, states + torques, state + torque)
        yield read(fmu, rates)


slave = fmpy.instantiate_fmu(folder, description, "CoSimulation")
points = zip(samples["states"], samples["torques"])
answers = {
    "next": [next(rollout(slave, state, [torque])) for state, torque in points],
    "rollout": list(rollout(slave, samples["start"], samples["held"])),
}
slave.terminate()
slave.freeInstance()

# Where torques are delayed or lag behind, what is set is not what acts.
exchange = description.modelExchange
if not exchange.needsCompletedIntegratorStep and len(description.derivatives) == len(rates):
    model = fmpy.instantiate_fmu(folder, description, "ModelExchange")
    answers["derivative"] = list(derivatives(model))
    model.terminate()
    model.freeInstance()

shutil.rmtree(folder)
json.dump(answers, sys.stdout)

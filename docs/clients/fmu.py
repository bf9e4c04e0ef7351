"""Run an exported FMU: python fmu.py MODEL.fmu SAMPLES.json prints what it predicts at the samples."""

import json
import pathlib
import shutil
import sys

import fmpy
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.validation import validate_fmu

path, samples = sys.argv[1], json.loads(pathlib.Path(sys.argv[2]).read_text())
if problems := validate_fmu(path):
    sys.exit("\n".join(problems))
description = fmpy.read_model_description(path)
folder = fmpy.extract(path)
reference = {variable.name: variable.valueReference for variable in description.modelVariables}
joints = [f"joint[{k + 1}]" for k in range(samples["joints"])]
states = [reference[f"{joint}.{what}"] for what in ("position", "velocity") for joint in joints]
rates = [reference[f"der({joint}.{what})"] for what in ("position", "velocity") for joint in joints]
torques = [reference.get(f"{joint}.torque", reference.get(f"{joint}.force")) for joint in joints]


def instance(kind, interface):
    fmu = kind(guid=description.instantiationToken, unzipDirectory=folder, modelIdentifier=interface.modelIdentifier, instanceName="model")
    fmu.instantiate()
    return fmu


def start(fmu, state):
    fmu.setFloat64(states, state)
    fmu.enterInitializationMode(startTime=0)
    fmu.exitInitializationMode()


def rollout(fmu, state, held):
    """The state after each step of co-simulation."""
    fmu.reset()
    start(fmu, state)
    for k, torque in enumerate(held):
        fmu.setFloat64(torques, torque)
        fmu.doStep(k * samples["step_s"], samples["step_s"])
        yield list(fmu.getFloat64(states))


def derivatives(fmu):
    """Rates of model exchange."""
    start(fmu, samples["start"])
    fmu.updateDiscreteStates()
    fmu.enterContinuousTimeMode()
    for state, torque in zip(samples["states"], samples["torques"]):
        fmu.setFloat64(states + torques, state + torque)
        yield list(fmu.getFloat64(rates))


slave = instance(FMU3Slave, description.coSimulation)
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
    model = instance(FMU3Model, exchange)
    answers["derivative"] = list(derivatives(model))
    model.terminate()
    model.freeInstance()

shutil.rmtree(folder)
json.dump(answers, sys.stdout)

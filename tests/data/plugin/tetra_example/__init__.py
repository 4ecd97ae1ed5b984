"""A plug-in of tetra_drake with a kind of friction, actuators, terrain, robot and policy."""

import math
from typing import NamedTuple

import numpy as np
from pydantic import Field

from tetra_drake.kernels.compiling import inlined
from tetra_drake.kernels.lanes import maximum
from tetra_drake.laws.actuator import SOFTEST, ActuatorForce, ActuatorFunctions, Limits, Winch
from tetra_drake.laws.cable import elastic_tension, slack_tension
from tetra_drake.laws.friction import FrictionFunctions, FrictionKind
from tetra_drake.laws.terrain import Grid, Relief
from tetra_drake.scenario.policies import PolicyKind, driven_names
from tetra_drake.scenario.robot_structure import ParametricRobot, StructureFile
from tetra_drake.scenario.structure_files import read_structure
from tetra_drake.settings.quantities import Damping, Length


class ViscousConstants(NamedTuple):
    damping: float


@inlined
def viscous_force(slide, law):
    return -law.damping * slide.t1.velocity, -law.damping * slide.t2.velocity


@inlined
def viscous_damping(slide, time, law):
    return time * law.damping, 0.0 * law.damping, time * law.damping


class Viscous(FrictionKind):
    """Friction of a film of oil: a force against the velocity, at any load."""

    own = FrictionFunctions(ViscousConstants, viscous_force, viscous_damping)
    modes = "always 0"

    damping: Damping = Field(gt=0)
    """Friction divided by velocity."""


@inlined
def servo_force(drive, length, rate, signal, cable, law):
    command = cable.free_length - signal / maximum(cable.stiffness, SOFTEST)
    wanted = (command - drive) / law.time_constant
    speed = wanted / (1.0 + abs(wanted) / law.max_speed)
    elastic = elastic_tension(length - drive, cable)
    tension, per_rate = slack_tension(elastic, rate - speed, cable)
    return ActuatorForce(tension, per_rate, speed, limited=0.0 * drive, beside=0.0 * drive)


class Servo(Winch):
    """Winch whose speed approaches its limit smoothly, whatever the tension."""

    own = ActuatorFunctions(Limits, servo_force)


class Waves(Relief):
    """Sine waves across the robot's path, below z = 0."""

    place = "over waves"

    height: Length = Field(gt=0)
    """Height from trough to crest."""
    wavelength: Length = Field(gt=0)
    """Distance of the crests."""

    def grid(self, *, ahead, scale, source):
        cell = self.wavelength / 16
        phase = np.arange(-400, 800)[:, np.newaxis] * math.tau / 16
        heights = np.tile(0.5 * self.height * (np.cos(phase) - 1.0), 3)
        return Grid(heights, (-400 * cell, -1.0), (cell, 1.0))


class Scaled(ParametricRobot):
    """The structure `prism` in another size; free lengths grow with it."""

    factor: float = Field(gt=0)
    """Size in units of the size of `prism`."""

    def structure(self):
        tree = read_structure("prism").model_dump()
        nodes = {node: [self.factor * x for x in place] for node, place in tree["nodes"].items()}
        for group in tree["cables"].values():
            group["free_length"] *= self.factor
        return StructureFile(**tree | {"nodes": nodes})


class Sine(PolicyKind):
    """Each driven cable has a sine of one hertz. The parameters are the amplitudes."""

    def parameters(self, blueprint):
        return dict.fromkeys(driven_names(blueprint), (-1.0, 1.0))

    def signals(self, robots, readings, values):
        sine = np.sin(math.tau * readings.time) * robots.amplitude
        return robots.as_given(sine[:, np.newaxis] * values)

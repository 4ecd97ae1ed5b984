"""A ground of one's own in place of ours: Drake's contact of spheres with a half space."""

# %% A LeafSystem with the ports of GroundContact. It asks a plant with contact geometry.
from pathlib import Path

import numpy as np
import pydrake.all as drake
from matplotlib.figure import Figure

import tetra_drake as td
from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import AddBodies, AddNodes
from tetra_drake.scenario.engine_kinds import Drake
from tetra_drake.systems.diagram import MakeTensegrityDiagram


class PointContact(drake.LeafSystem):
    """Drake's point contact under a robot's contact nodes: stiffness (N/m), dissipation (s/m) and a
    coefficient of friction."""

    def __init__(self, robot: Robot, *, stiffness: float, dissipation: float, friction: float):
        super().__init__()
        builder, structure = drake.DiagramBuilder(), robot.structure
        plant, _ = drake.AddMultibodyPlantSceneGraph(builder, time_step=0.0)
        nodes = AddNodes(plant, structure, AddBodies(plant, structure))
        material = drake.ProximityProperties()
        # Two springs in series, the sphere's and the ground's, are half as stiff as one.
        coulomb = drake.CoulombFriction(friction, friction)
        drake.AddContactMaterial(dissipation, 2.0 * stiffness, coulomb, material)
        for node in structure.contacts:
            frame, name = nodes[node], f"node {node}"
            pose, sphere = frame.GetFixedPoseInBodyFrame(), drake.Sphere(1e-3)
            plant.RegisterCollisionGeometry(frame.body(), pose, sphere, name, material)
        below = drake.RigidTransform([0.0, 0.0, -1e-3])  # the nodes themselves touch at height 0
        plant.RegisterCollisionGeometry(
            plant.world_body(), below, drake.HalfSpace(), "ground", material
        )
        plant.set_stiction_tolerance(2e-3)
        plant.Finalize()
        self._diagram, self._plant = builder.Build(), plant
        self._context = self._diagram.CreateDefaultContext()
        self.DeclareVectorInputPort("state", 13 * len(structure.bodies))
        self.DeclareVectorOutputPort("generalized_force", 6 * len(structure.bodies), self._calc)

    def _calc(self, context: drake.Context, output: drake.BasicVector) -> None:
        own = self._plant.GetMyMutableContextFromRoot(self._context)
        self._plant.SetPositionsAndVelocities(own, self.EvalVectorInput(context, 0).value())
        forces = self._plant.get_generalized_contact_forces_output_port(
            self._plant.GetModelInstanceByName("DefaultModelInstance")
        )
        output.SetFromVector(forces.Eval(own))


# %% The same gait on our ground and on Drake's, under Coulomb friction, for four seconds.
scenario = td.load_scenario("coulomb").with_changes({"friction.stiffness": "0 N/m"})
robot, times = Robot.of(scenario), np.linspace(0.0, 4.0, 201)
gait, stiffness = td.seeded_gait(scenario), scenario.ground.stiffness
dissipation = scenario.ground.damping / stiffness
point = PointContact(robot, stiffness=stiffness, dissipation=dissipation, friction=0.5)

ways = {}
for name, ground in {"ours": None, "Drake's": point}.items():
    diagram = MakeTensegrityDiagram(robot, gait, ground=ground)
    simulator, found = MakeSimulator(diagram, robot, Drake(max_step=2e-3)), []
    for time in times:
        simulator.AdvanceTo(time)
        found.append(diagram.GetOutputPort("state").Eval(simulator.get_context())[4])
    ways[name] = (np.array(found) - found[0]) / 0.0254
    print(f"{name}: {ways[name][-1]:.3f} in")

# %% The way of the rear tetrahedron.
figure = Figure(figsize=(7.0, 3.0), layout="constrained")
axes = figure.subplots()
for name, way in ways.items():
    axes.plot(times, way, label=name)
axes.set(xlabel="time (s)", ylabel="way (in)")
axes.legend()
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)

"""What `structure` says of heavy robots and of turned ones."""

import numpy as np
from helpers.converged import shortly

from tetra_drake.engines.simulate import simulate
from tetra_drake.lab.study.equilibrium import robot_of_file, structure_text, study_equilibrium
from tetra_drake.report.summary import result_text
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.remarks import sinking_remark
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario


def test_a_robot_that_sinks_into_its_ground_is_told_a_stiffness(tmp_path, result):
    file = tmp_path / "soft.yaml"
    file.write_text("{base: prism, name: soft, ground: {stiffness: 20 N/m, damping: 0 N*s/m^2}}")
    study = study_equilibrium(robot_of_file(str(file)))
    depth, height = -study.nodes["z"].min(), np.ptp(study.nodes["z"])
    assert depth > 0.03 * height
    told = study.robot.scenario.units.shown(20.0 * depth / (0.01 * height), "N/m")
    assert f"a ground.stiffness of {told} would bear it" in structure_text(study)
    assert "would bear it" not in structure_text(study_equilibrium(robot_of_file("prism")))
    short = shortly(load_scenario(file), 0.05)
    assert told in result_text(simulate(short, seeded_gait(short, 0)))
    assert "would bear it" not in result_text(result)
    floating = load_scenario(file).with_changes({"terrain": "!Nothing", "robot.gravity": 0.0})
    assert not sinking_remark(Robot.of(floating))

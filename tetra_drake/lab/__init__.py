"""Laboratory: what is built on the model and is not the model. The core never imports it.

bridges        files of MuJoCo and NTRT become structures; SDFormat
fit            values of a scenario that meet measurements
predict        medians and intervals from tolerances
linearization  Drake's LinearSystem of small motions, modes, LQR
comparison     how well runs search
elites         quality diversity: maps of gaits
form, spread   force densities; starts moved by 1 nm
planner        a controller that plans by sampled motions
prototype      commands for the actuators of a robot
gym            Gymnasium environments
films          videos of replay pages
cluster        executors on Dask's workers
"""

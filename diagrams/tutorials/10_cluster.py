"""Ten machines: evolution on a Dask cluster, tried on this machine."""

# %% Worker processes import this file, so the code that starts them is below `if __name__`.
from pathlib import Path

import tetra_drake as td
from tetra_drake.figures.fitness import fitness_of_trials
from tetra_drake.lab.cluster import dask_cluster, local_cluster


def main() -> None:
    """Evolves a few gaits by two workers."""
    # %% On ten machines: dask.distributed.SSHCluster(["node0", "node0", "node1", ...],
    # worker_options={"nthreads": 1}), or dask_jobqueue.SLURMCluster, in place of local_cluster().
    scenario = td.load_scenario("coulomb").with_changes(
        {
            "optimizer": "!CmaEs",
            "evolution.trials": 2,
            "evolution.evaluations": 53,
            "simulation.duration": "5 s",
        }
    )
    with local_cluster(2) as cluster, dask_cluster(cluster) as executor:
        run = td.evolve(
            scenario,
            "out/cluster",
            executor=executor,
            overwrite=True,
            reevaluate=False,
            report=False,
        )
    print(run)
    fitness_of_trials(run).savefig(f"{Path(__file__).stem}.png", dpi=120)


if __name__ == "__main__":
    main()

"""Recorded runs, each read once."""

import functools

import tables

from tetra_drake.evolution.run import Run, load_run


@functools.cache
def recorded_run(name: str) -> Run:
    return load_run(tables.HERE / name)

"""A function that no other process can load: this module cannot be imported twice."""

import os

if os.environ.get("TETRA_DRAKE_LOADED_IN", str(os.getpid())) != str(os.getpid()):
    raise ImportError("only one process can load this")
os.environ["TETRA_DRAKE_LOADED_IN"] = str(os.getpid())


def evaluate(task):
    """As Bowl."""
    from helpers.analytic import Bowl

    return Bowl()(task)

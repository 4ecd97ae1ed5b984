"""Messages say what was found, but not all of it."""

import pytest

from tetra_drake.errors import InputError

LONG = 100_000 * "x"
PROBLEMS = {f"found '{LONG}', expected a number": "', expected a number", "word " * 20_000: "word"}


@pytest.mark.parametrize(("problem", "kept"), PROBLEMS.items(), ids=["quotation", "words"])
def test_little_is_quoted_of_what_is_long(problem, kept):
    error = InputError(LONG[:4000], LONG, problem)
    place, key, told = str(error).split(": ")
    assert place == LONG[:4000]
    assert key == f"{LONG[:60]} ..."
    assert len(f"{key}: {told}") <= 270 and kept in told
    assert " ".join(error.problem.split()) == told


def test_a_usual_problem_is_told_in_full():
    problem = f"found '{LONG[:150]}', expected one of " + ", ".join(f"name_{i}" for i in range(9))
    assert str(InputError("a.yaml", "key", problem)) == f"a.yaml: key: {problem}"


def test_a_message_is_one_line_that_a_terminal_does_not_obey():
    error = InputError("a\nb.csv", "\x1b[2J", "found '1\x1b[31m\r\n2\0'")
    assert str(error) == "a b.csv: \\x1b[2J: found '1\\x1b[31m 2\\x00'"

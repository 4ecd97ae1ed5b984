"""What the digest of a kernel depends on."""

import textwrap
from collections import namedtuple
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import yaml

from tetra_drake.kernels.compiling import compiled, inlined
from tetra_drake.kernels.stamp import stamp

USES = yaml.safe_load(Path(__file__).with_name("uses.yaml").read_text("utf-8"))


def function_of(text, value, comment="", doc="", field="a", other=0.0):
    """The function outer(x) with a text that uses `value`; `other` is a number that it uses not."""
    source = f"""
        def called(x):
            \"\"\"{doc}\"\"\"
            return x * VALUE  # {comment}

        def make(a):
            return lambda x: x * a

        def with_default(x, a=VALUE):
            return x * a

        def outer(x):
            # {comment}
            {text.format(value=value)}
        """
    space = {
        "VALUE": value,
        "TABLE": np.array([value]),
        "PAIR": (3, value),
        "UNUSED": other,
        "Point": namedtuple("Point", field if value == 1.0 else "b"),
        "other": ModuleType("another"),
        "__name__": "tetra_drake.of_a_test",
    }
    vars(space["other"]).update(VALUE=value, UNUSED=other)
    exec(textwrap.dedent(source), space)
    space["kernel"] = compiled(space["called"])
    space["of_closure"] = space["make"](value)
    return space["outer"]


def in_module(module, source, **names):
    """The value `outer` of a module's source."""
    space = names | {"__name__": f"tetra_drake.{module}"}
    exec(source, space)
    return space["outer"]


@pytest.mark.parametrize("text", USES.values(), ids=USES.keys())
def test_a_digest_changes_with_what_is_used_and_with_nothing_else(text):
    first = stamp(function_of(text, 1.0))
    assert first == stamp(function_of(text, 1.0, comment="more", doc="Of it.", other=7.0))
    assert first != stamp(function_of(text, 2.0))


def test_values_that_are_exchanged_change_a_digest():
    def of(first, second):
        return stamp(in_module("of_a_test", "def outer(x): return a * x + b", a=first, b=second))

    assert of(1.0, 2.0) != of(2.0, 1.0)


@pytest.mark.parametrize("source", ["def outer(x): return x", "outer = namedtuple('outer', 'a')"])
def test_what_machine_code_imports_from_another_module_changes_a_digest(source):
    def of(module):
        used = in_module(module, source, namedtuple=namedtuple)
        return stamp(in_module("user", "def outer(x): return used(x)", used=used))

    assert of("one") == of("one") != of("another")


def test_the_way_of_compilation_is_a_part():
    def twice(x):
        return 2.0 * x

    assert stamp(compiled(twice)) != stamp(compiled(twice, nogil=True)) != stamp(inlined(twice))

"""Laws with functions of their own: compiled for the robots that have them, and only for those."""

from typing import NamedTuple

import numpy as np
import pytest

from tetra_drake.errors import InputError
from tetra_drake.kernels.compiling import compiled, inlined, machine_code
from tetra_drake.kernels.packed import Packed, unpacked
from tetra_drake.laws.friction import (
    OWN,
    Coulomb,
    FrictionFunctions,
    FrictionLaw,
    Slide,
    TangentSlide,
    friction_force,
)


class Oil(NamedTuple):
    damping: float


@inlined
def oil_force(slide, law):
    return -law.damping * slide.t1.velocity, -law.damping * slide.t2.velocity


@inlined
def misspelt_force(slide, law):
    return -law.dampin * slide.t1.velocity, 0.0


@inlined
def oil_damping(slide, time, law):
    return time * law.damping, 0.0 * law.damping, time * law.damping


@compiled
def write_force(parts, numbers):
    (law,) = unpacked(parts)
    still = 0.0 * numbers[0]
    slide = Slide(
        TangentSlide(numbers[0], still, still),
        TangentSlide(numbers[1], still, still),
        (1.0, 0.0),
        2.0,
    )
    numbers[2], numbers[3] = friction_force(law, slide)


def force_of(law: FrictionLaw) -> np.ndarray:
    numbers, parts = np.array([0.1, -0.2, 0.0, 0.0]), Packed((law,))
    machine_code(write_force, parts, numbers)(parts, numbers)
    return numbers[2:]


def law_of(force, damping=oil_damping) -> FrictionLaw:
    return FrictionLaw(OWN, np.array([3.0]), FrictionFunctions(Oil, force, damping))


def test_a_law_of_its_own_is_in_the_machine_code_beside_the_shipped_ones():
    assert force_of(law_of(oil_force)).tolist() == [-3.0 * 0.1, 3.0 * 0.2]
    weak = Coulomb(static=0.1, kinetic=0.1).law()
    assert np.linalg.norm(force_of(weak)) == pytest.approx(0.1 * 2.0)
    assert Packed((weak,)).kind != Packed((law_of(oil_force),)).kind


def test_a_function_that_numba_cannot_compile_is_one_line_with_its_place():
    with pytest.raises(InputError, match="'dampin' of type Oil") as refused:
        force_of(law_of(misspelt_force))
    assert "test_own.py (" in refused.value.source and "\n" not in str(refused.value)

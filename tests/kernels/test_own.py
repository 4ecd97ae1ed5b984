"""Laws with functions of their own: compiled for the robots that have them, and only for those."""

import numpy as np
import pytest
from data.plugin.tetra_example import Viscous, ViscousConstants, viscous_damping

from tetra_drake.errors import InputError
from tetra_drake.kernels.compiling import compiled, inlined, machine_code
from tetra_drake.kernels.packed import Packed, unpacked
from tetra_drake.laws.friction import (
    Coulomb,
    FrictionFunctions,
    FrictionLaw,
    Slide,
    TangentSlide,
    friction_force,
)


@inlined
def misspelt_force(slide, law):
    return -law.dampin * slide.t1.velocity, 0.0


class Misspelt(Viscous):
    own = FrictionFunctions(ViscousConstants, misspelt_force, viscous_damping)


@compiled
def write_force(parts, numbers):
    (law,) = unpacked(parts)
    still = 0.0 * numbers[0]
    t1, t2 = TangentSlide(numbers[0], still, still), TangentSlide(numbers[1], still, still)
    numbers[2], numbers[3] = friction_force(law, Slide(t1, t2, (1.0, 0.0), 2.0))


def force_of(law: FrictionLaw) -> np.ndarray:
    numbers, parts = np.array([0.1, -0.2, 0.0, 0.0]), Packed((law,))
    machine_code(write_force, parts, numbers)(numbers)
    return numbers[2:]


def test_a_law_of_its_own_is_in_the_machine_code_beside_the_shipped_ones():
    oil, weak = Viscous(damping=3.0).law(), Coulomb(static=0.1, kinetic=0.1).law()
    assert force_of(oil).tolist() == [-3.0 * 0.1, 3.0 * 0.2]
    assert np.linalg.norm(force_of(weak)) == pytest.approx(0.1 * 2.0)
    assert Packed((weak,)).kind != Packed((oil,)).kind


def test_a_function_that_numba_cannot_compile_is_one_line_with_its_place():
    with pytest.raises(InputError, match="'dampin' of type ViscousConstants") as refused:
        force_of(Misspelt(damping=3.0).law())
    assert "test_own.py (" in refused.value.source and "\n" not in str(refused.value)

"""Kinds of contact between struts of different bodies.

The kernels need numba; they are imported when a law is needed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from pydantic import Field

from tetra_drake.settings.quantities import InverseSpeed, Stiffness
from tetra_drake.settings.section import Kinds, Section

if TYPE_CHECKING:
    from tetra_drake.laws.capsules import Search, StrutContactLaw


class NoStrutContact(Section):
    """Struts pass through each other, as in the thesis."""

    tag: ClassVar[str] = "Nothing"

    def law(self, search: Search) -> StrutContactLaw:
        """The law in the form of the kernels. `search` has the distances of the search."""
        from tetra_drake.laws.capsules import StrutContactLaw

        return StrutContactLaw(acts=False, normal=np.zeros(2), search=np.array(search))


class HuntCrossley(Section):
    """Struts touch as capsules of their radii, without friction. The force at a depth d of their
    overlap is F = k d (1 + c d'); see laws.capsules."""

    stiffness: Stiffness = Field(gt=0)
    """Force per depth, k."""
    dissipation: InverseSpeed = Field(ge=0)
    """Hunt-Crossley dissipation c, as Drake's. It lowers the restitution of an impact at a low
    speed v: e = 1 - 2/3 c v."""

    def law(self, search: Search) -> StrutContactLaw:
        """The law in the form of the kernels. `search` has the distances of the search."""
        from tetra_drake.laws.capsules import StrutContactLaw
        from tetra_drake.laws.contact import NormalForce

        normal = NormalForce(self.stiffness, damping=self.stiffness * self.dissipation)
        return StrutContactLaw(acts=True, normal=np.array(normal), search=np.array(search))


StrutContactKind = Annotated[NoStrutContact | HuntCrossley, Kinds()]

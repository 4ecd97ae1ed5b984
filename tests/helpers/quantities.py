"""SI numbers as scenario files have them."""

from typing import Any

import numpy as np
import numpy.typing as npt


def with_unit(numbers: npt.ArrayLike, unit: str) -> Any:
    """Numbers in an SI unit as texts in nested lists, which read back exactly."""
    if np.ndim(numbers) == 0:
        return f"{float(numbers)!r} {unit}"  # type: ignore[arg-type]
    return [with_unit(number, unit) for number in np.asarray(numbers)]

"""Index of labels that repeat along a dimension, such as the bodies that cables join."""

from __future__ import annotations

from typing import Any

import numpy as np
from xarray.core.indexing import IndexSelResult
from xarray.indexes import PandasIndex

from tetra_drake.errors import InputError
from tetra_drake.settings.refusals import hint


class LabelIndex(PandasIndex):
    """Index of a coordinate whose labels may repeat; a label selects all entries that have it.

    The unique names along the same dimension use xarray's own index, because xarray can only align
    arrays with equal kinds of index.
    """

    def sel(
        self, labels: dict[Any, Any], method: str | None = None, tolerance: Any = None
    ) -> IndexSelResult:
        """Positions of all entries that have one given label, or one of several in a list.

        `labels` has the name of the coordinate and what is given for it: label, list, slice or
        Boolean mask. Slices and masks work as in xarray, with its `method` and `tolerance`. Raises
        InputError for an unknown label.
        """
        ((coordinate, given),) = labels.items()
        wanted = np.asarray(given)
        if isinstance(given, slice) or wanted.dtype.kind == "b":
            return super().sel(labels, method=method, tolerance=tolerance)
        missing = [str(label) for label in wanted.ravel() if label not in self.index]
        if missing:
            unknown = ", ".join(f"'{label}'" for label in missing)
            advice = hint(missing[0], map(str, self.index.unique()))
            raise InputError("sel", str(coordinate), f"found the unknown {unknown}; {advice}")
        if wanted.ndim == 1:
            return IndexSelResult({self.dim: np.flatnonzero(self.index.isin(wanted))})
        return super().sel(labels, method=method, tolerance=tolerance)

"""Curvature of a path, and travelling index of waves."""

from __future__ import annotations

import math

import numpy as np

_SWAY = 2e-3
"""Size (m) of the path of a robot that only sways on the spot. Such a path counts as straight."""


def curvature(points: np.ndarray, *, scale: float = 1.0) -> float:
    """Curvature (1/m) of the circle that fits the points (k, 2) of a path in m.

    The curvature is positive if the path bends to the left, and 0 on a line. Taubin's fit (IEEE
    Trans. PAMI 13, 1991, 1115): the circle is bend / (2 size) (p . p - size^2) + normal . p = 0,
    with points p relative to the mean of all, and their root mean square length `size`. The unit
    vector (bend, normal) of three numbers minimises the mean square of the left side. A path that
    is hardly larger than 2 mm (_SWAY) times `scale`, the ratio of the robot's size to a usual one,
    counts as almost straight: a term is added that keeps its curvature small. At a scale of 1 it
    has no effect on a path of 10 cm.
    """
    sway = scale * _SWAY
    (x, y), count = points.T, len(points)
    x, y = x - x.sum() / count, y - y.sum() / count
    square = x * x + y * y
    size = math.sqrt(square.sum() / count)
    if size < 1e-3 * sway:
        return 0.0
    table = np.array([(square - size * size) / (2.0 * size), x, y])
    moments = table @ table.T / count
    moments[0, 0] += (sway * sway / size) ** 2
    # (bend, normal) is the eigenvector with the smallest eigenvalue.
    bend, normal_x, normal_y = np.linalg.eigh(moments)[1][:, 0].tolist()
    bend /= size
    # Twice the area swept by the ray from the circle's centre, times +-1 / radius.
    swept = bend * (x[:-1] @ y[1:] - y[:-1] @ x[1:])
    swept += normal_x * (y[-1] - y[0]) - normal_y * (x[-1] - x[0])
    return math.copysign(bend, bend * swept)


def travelling_index(waves: np.ndarray) -> float:
    """Travelling index of waves (samples, positions): 0 for standing waves, 1 for travelling waves.

    A column of `waves` is the time series at one position, in evenly spaced samples. The index is
    the ratio of the singular values of the real and imaginary parts of the strongest complex
    orthogonal mode (B. F. Feeny, Journal of Sound and Vibration 310, 2008). The index of fewer than
    two positions is 0.
    """
    if waves.shape[1] < 2:
        return 0.0
    # The mode of the analytic signals; their spectrum has no negative frequencies.
    spectrum = np.fft.rfft(waves, axis=0)[1:]
    mode = np.linalg.eigh(spectrum.T @ spectrum.conj())[1][:, -1]
    # The real and imaginary parts have the Gram matrix [[a, c], [c, b]], a + b = 1.
    a, c = float(mode.real @ mode.real), float(mode.real @ mode.imag)
    spread = math.hypot(2.0 * a - 1.0, 2.0 * c)
    return math.sqrt(max(0.0, 1.0 - spread) / (1.0 + spread))

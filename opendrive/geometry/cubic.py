"""Cubics a + b x + c x^2 + d x^3, as arrays (..., 4) of their coefficients."""

import numpy as np

from opendrive.arrays import FloatArray


def value_of(k: FloatArray, x: FloatArray) -> FloatArray:
    """Return the values of cubics with coefficients (..., 4) at `x` (...)."""
    value: FloatArray = k[..., 0] + x * (k[..., 1] + x * (k[..., 2] + x * k[..., 3]))
    return value


def slope_of(k: FloatArray, x: FloatArray) -> FloatArray:
    """Return the derivatives of cubics with coefficients (..., 4) at `x` (...)."""
    slope: FloatArray = k[..., 1] + x * (2.0 * k[..., 2] + x * 3.0 * k[..., 3])
    return slope


def restarted(k: FloatArray, x: FloatArray) -> FloatArray:
    """Return the coefficients (..., 4) of the same cubics over the distance from `x` (...)."""
    c, d = k[..., 2], k[..., 3]
    return np.stack([value_of(k, x), slope_of(k, x), c + 3.0 * x * d, d], axis=-1)


def control_values(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """Return the Bezier control values (4, ...) of cubics over [0, 1], which lie within their hull."""
    return np.stack([a, a + b / 3.0, a + (2.0 * b + c) / 3.0, a + b + c + d])

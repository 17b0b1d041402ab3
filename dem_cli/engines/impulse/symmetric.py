"""Symmetric matrices of three dimensions as tuples xx, yy, zz, xy, xz, yz, and in the rows of arrays (n, 6)."""

from __future__ import annotations

from dem_cli.jit import kernel


@kernel(inline=True)
def symmetric_times(m, a):
    """The symmetric matrix m times a."""
    return (
        m[0] * a[0] + m[3] * a[1] + m[4] * a[2],
        m[3] * a[0] + m[1] * a[1] + m[5] * a[2],
        m[4] * a[0] + m[5] * a[1] + m[2] * a[2],
    )


@kernel(inline=True)
def symmetric_inverse(m):
    """Inverse of a symmetric positive definite matrix, by cofactors."""
    xx = m[1] * m[2] - m[5] * m[5]
    xy = m[5] * m[4] - m[3] * m[2]
    xz = m[3] * m[5] - m[1] * m[4]
    over = 1.0 / (m[0] * xx + m[3] * xy + m[4] * xz)
    yy = m[0] * m[2] - m[4] * m[4]
    yz = m[3] * m[4] - m[0] * m[5]
    zz = m[0] * m[1] - m[3] * m[3]
    return xx * over, yy * over, zz * over, xy * over, xz * over, yz * over

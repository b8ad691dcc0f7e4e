"""Small symmetric tensors and matrices, as numbers that stay in registers.

Components are in the order xx, yy, zz, xy, yz, zx; in two dimensions those with z are 0.
"""

from __future__ import annotations

import math

from numba import njit

#: Sweeps of Jacobi's rotations; three are enough for round-off.
_SWEEPS = 6


@njit(error_model="numpy")
def turn(one, other, mixed):
    """Cosine, sine and tangent of the Jacobi rotation that makes ``mixed`` vanish."""
    if mixed == 0.0:
        return 1.0, 0.0, 0.0
    half = 0.5 * (other - one) / mixed
    t = 1.0 / (abs(half) + math.sqrt(half * half + 1.0))
    if half < 0.0:
        t = -t
    c = 1.0 / math.sqrt(t * t + 1.0)
    return c, t * c, t


@njit(error_model="numpy")
def carried(xx, yy, zz, xy, yz, zx, least):
    """Projector on the eigenvectors of a symmetric tensor whose eigenvalues are above ``least``.

    By Jacobi's rotations. The order of components is that of the arguments.
    """
    ax, ay, az = 1.0, 0.0, 0.0
    bx, by, bz = 0.0, 1.0, 0.0
    cx, cy, cz = 0.0, 0.0, 1.0
    for _ in range(_SWEEPS):
        c, s, t = turn(xx, yy, xy)
        xx, yy, xy = xx - t * xy, yy + t * xy, 0.0
        zx, yz = c * zx - s * yz, s * zx + c * yz
        ax, bx = c * ax - s * bx, s * ax + c * bx
        ay, by = c * ay - s * by, s * ay + c * by
        az, bz = c * az - s * bz, s * az + c * bz
        c, s, t = turn(yy, zz, yz)
        yy, zz, yz = yy - t * yz, zz + t * yz, 0.0
        xy, zx = c * xy - s * zx, s * xy + c * zx
        bx, cx = c * bx - s * cx, s * bx + c * cx
        by, cy = c * by - s * cy, s * by + c * cy
        bz, cz = c * bz - s * cz, s * bz + c * cz
        c, s, t = turn(zz, xx, zx)
        zz, xx, zx = zz - t * zx, xx + t * zx, 0.0
        yz, xy = c * yz - s * xy, s * yz + c * xy
        cx, ax = c * cx - s * ax, s * cx + c * ax
        cy, ay = c * cy - s * ay, s * cy + c * ay
        cz, az = c * cz - s * az, s * cz + c * az
    a = 1.0 if xx > least else 0.0
    b = 1.0 if yy > least else 0.0
    c = 1.0 if zz > least else 0.0
    return (
        a * ax * ax + b * bx * bx + c * cx * cx,
        a * ay * ay + b * by * by + c * cy * cy,
        a * az * az + b * bz * bz + c * cz * cz,
        a * ax * ay + b * bx * by + c * cx * cy,
        a * ay * az + b * by * bz + c * cy * cz,
        a * az * ax + b * bz * bx + c * cz * cx,
    )


@njit(error_model="numpy")
def times(xx, yy, zz, xy, yz, zx, x, y, z):
    """Symmetric tensor times vector."""
    return xx * x + xy * y + zx * z, xy * x + yy * y + yz * z, zx * x + yz * y + zz * z


@njit(error_model="numpy")
def within(p, xx, yy, zz, xy, yz, zx):
    """Π R Π for a projector p (components as in :func:`carried`), without its trace."""
    ax, ay, az = times(xx, yy, zz, xy, yz, zx, p[0], p[3], p[5])
    bx, by, bz = times(xx, yy, zz, xy, yz, zx, p[3], p[1], p[4])
    cx, cy, cz = times(xx, yy, zz, xy, yz, zx, p[5], p[4], p[2])
    rx, rxy, rzx = times(p[0], p[1], p[2], p[3], p[4], p[5], ax, ay, az)
    _, ry, ryz = times(p[0], p[1], p[2], p[3], p[4], p[5], bx, by, bz)
    _, _, rz = times(p[0], p[1], p[2], p[3], p[4], p[5], cx, cy, cz)
    mean = (rx + ry + rz) / max(1.0, p[0] + p[1] + p[2])
    return (
        rx - mean * p[0],
        ry - mean * p[1],
        rz - mean * p[2],
        rxy - mean * p[3],
        ryz - mean * p[4],
        rzx - mean * p[5],
    )


@njit(error_model="numpy")
def is_thin(xx, yy, zz, xy, yz, zx, least, DIM):
    """Whether an eigenvalue is at most ``least``: the shifted tensor is not positive definite."""
    x, y = xx - least, yy - least
    minor = x * y - xy * xy
    if DIM == 2:
        return not (x > 0.0 and minor > 0.0)
    z = zz - least
    last = z * minor - x * yz * yz - y * zx * zx + 2.0 * xy * yz * zx
    return not (x > 0.0 and minor > 0.0 and last > 0.0)


@njit(error_model="numpy")
def factorise(moments, first, number, shift):
    """Cholesky factor of a packed symmetric matrix plus a shift, in place."""
    for a in range(number):
        row = first + a * (a + 1) // 2
        for b in range(a + 1):
            column = first + b * (b + 1) // 2
            total = moments[row + b]
            if a == b:
                total += shift
            for c in range(b):
                total -= moments[row + c] * moments[column + c]
            if a == b:
                moments[row + a] = math.sqrt(total)
            else:
                moments[row + b] = total / moments[column + b]


@njit(error_model="numpy")
def substitute(moments, first, right, number):
    """Solve with the factor of :func:`factorise`; ``right`` is where the right-hand side is."""
    for a in range(number):
        row = first + a * (a + 1) // 2
        total = moments[right + a]
        for b in range(a):
            total -= moments[row + b] * moments[right + b]
        moments[right + a] = total / moments[row + a]
    for back in range(number):
        a = number - 1 - back
        total = moments[right + a]
        for b in range(a + 1, number):
            total -= moments[first + b * (b + 1) // 2 + a] * moments[right + b]
        moments[right + a] = total / moments[first + a * (a + 1) // 2 + a]

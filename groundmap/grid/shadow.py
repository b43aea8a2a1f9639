"""The region between a new surface and the older boundary of freespace (paper, section 4.2)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Bools, Floats32, as_floats
from groundmap.errors import InputError
from groundmap.grid.height_layers import NO_TOP
from groundmap.grid.kernels.shadow import mark_shadow


def behind_new_surfaces(free: Bools, z: Floats32, viewpoint: npt.ArrayLike) -> Bools:
    """Return the free cells that a view's new surfaces hide, as far as the older boundary.

    A surface is new where its cell was free. A cell is hidden by it if the straight way from the
    cell to the viewpoint meets the surface first, past nothing but free cells without evidence:
    an older surface in between bounds the region, and so does unknown space.

    Parameters
    ----------
    free : ndarray of bool
        Cells that were free before the view.
    z : ndarray of float32, of the same shape
        Evidence of the view.
    viewpoint : array_like, shape (d,)
        Viewpoint in cells of the block, in the order of its axes; cell i spans i to i + 1.

    Examples
    --------
    >>> free = np.array([[True, True, True, False, True]])
    >>> z = np.array([[-1.0, 1.0, 0.0, 0.0, 0.0]], dtype=np.float32)
    >>> behind_new_surfaces(free, z, (0.5, 0.5))
    array([[False, False,  True, False, False]])
    """
    eye = as_floats("viewpoint", viewpoint, (free.ndim,))
    shadow = np.zeros(free.shape, dtype=np.bool_)
    if (free & (z > 0.0)).any():
        flat = (1,) * (3 - free.ndim)  # a 2-D block is a 3-D one with one layer
        eye = np.concatenate([np.full(len(flat), 0.5), eye])
        shape = flat + free.shape
        mark_shadow(z.reshape(shape), free.reshape(shape), eye, shadow.reshape(shape))
    return shadow


def with_shadow(
    z: npt.NDArray[np.floating], height: Floats32 | None, shadow: npt.ArrayLike
) -> tuple[Floats32, Floats32 | None]:
    """Return evidence and heights of a view; its shadow is non-free, without an observed top.

    Parameters
    ----------
    z : ndarray of float
    height : ndarray of float32 or None [m]
    shadow : array_like of bool, of z's shape

    Raises
    ------
    InputError
        The shadow has another shape or type.
    """
    mask = np.asarray(shadow)
    if mask.shape != z.shape or mask.dtype != np.bool_:
        got = f"{mask.dtype} of shape {mask.shape}"
        raise InputError("shadow", f"bool of shape {z.shape}", got)
    hidden = mask & (z == 0)
    filled = np.where(hidden, np.float32(1.0), z).astype(np.float32)
    return filled, None if height is None else np.where(hidden, np.float32(NO_TOP), height)

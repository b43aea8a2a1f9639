"""The one motion that explains the features of two views, or the reason why there is none."""

from __future__ import annotations

import numpy as np

from groundmap.arrays import Floats
from groundmap.errors import RegistrationError
from groundmap.registration.feature_set import FeatureSet, bins_of
from groundmap.registration.matching import Bounds, Search
from groundmap.registration.motion_model import MotionModel
from groundmap.registration.settings import RegistrationSettings
from groundmap.registration.solving import Alignment, polish, scale_of, support_by_chance

SAME = 0.5  # share of common matches from which two alignments are the same motion
PROMISING = 0.4  # share of the best support
POOLS = (200, 400)  # best features that triangles are made of, one after the other
ENOUGH = 3  # triangles of the best motion that were found; those of a better would be more
STRONG = 5.0  # multiple of the support by chance that is enough at the end of a search
ABOVE_CHANCE = 2.0  # least support, as a multiple of that by chance
AXES = ("right", "down", "forward")


def find_motion(
    a: FeatureSet,
    b: FeatureSet,
    bounds: Bounds,
    model: MotionModel,
    options: RegistrationSettings,
) -> Alignment:
    """Return the motion from A to B under which most features agree.

    Parameters
    ----------
    a, b : FeatureSet
    bounds : Bounds
    model : MotionModel
    options : RegistrationSettings

    Raises
    ------
    RegistrationError
        Too few features agree, two motions explain them alike, or the matches leave a direction
        open.
    """
    _check_enough(len(a.xyz), len(b.xyz), options)
    found = _Found(a, b, model)
    settled = False
    for pool in POOLS:
        if not settled:
            search = Search(a, b, bounds, model, pool=pool, seed=options.seed)
            settled = _search(search, found, options.rounds // len(POOLS))
    best, rival = found.best, found.rival
    if best is None:
        raise _too_few("none of their triangles agree", a, b)
    chance = support_by_chance(best, a, b, found.bins)
    if best.support < max(options.min_matches, ABOVE_CHANCE * chance):
        text = f"{best.support} agree under the best motion, {chance:.0f} by chance"
        raise _too_few(text, a, b)
    if rival is not None and rival.support - chance > options.rival * (best.support - chance):
        shift = float(np.linalg.norm(rival.pose[:, 3] - best.pose[:, 3]))
        raise RegistrationError(
            "ambiguous",
            f"two motions that are {shift:.3g} m apart explain the features alike: "
            f"{best.support} and {rival.support} of {len(a.xyz)} agree.",
        )
    if not settled and best.support < STRONG * chance:
        text = f"{best.support} agree ({chance:.0f} by chance), too few to rule out another motion"
        raise _too_few(text, a, b)
    _check_determined(best, model, options)
    return best


def covariance_of(alignment: Alignment, model: MotionModel) -> Floats:
    """Return the covariance of a motion in B: translation [m] and rotation vector [rad].

    Parameters
    ----------
    alignment : Alignment
    model : MotionModel

    Returns
    -------
    ndarray, shape (6, 6)
    """
    reduced = scale_of(alignment) * np.linalg.inv(alignment.information)
    covariance: Floats = model.directions @ reduced @ model.directions.T
    return covariance


def _search(search: Search, found: _Found, rounds: int) -> bool:
    """Add motions to those found; return whether the search rules out that there is a better one.

    Parameters
    ----------
    search : Search
    found : _Found
    rounds : int
        Largest number of rounds.
    """
    for _ in range(rounds):
        found.add(search.round(found.known))
        if found.best is not None and search.triangles_of(found.best) >= ENOUGH:
            # A motion along a repeating structure matches the same features, to others.
            found.add(search.round(found.known, among=found.best))
            return True
    return False


class _Found:
    """The best two motions of a search."""

    def __init__(self, a: FeatureSet, b: FeatureSet, model: MotionModel) -> None:
        self.a, self.b, self.bins = a, b, bins_of(b)
        self.directions = model.directions
        self.best: Alignment | None = None
        self.rival: Alignment | None = None

    @property
    def known(self) -> list[Alignment]:
        return [motion for motion in (self.best, self.rival) if motion is not None]

    def add(self, motions: list[Alignment]) -> None:
        """Polish new motions that are promising, and keep the best two."""
        for motion in motions:
            least = 0.0 if self.best is None else PROMISING * self.best.support
            if motion.support < least or any(_same(motion, other) for other in self.known):
                continue
            polished = polish(motion, self.a, self.b, self.bins, directions=self.directions)
            ranked = sorted([*self.known, polished], key=_support, reverse=True)
            self.best = ranked[0]
            others = [other for other in ranked[1:] if not _same(other, self.best)]
            self.rival = others[0] if others else None


def _support(alignment: Alignment) -> int:
    return alignment.support


def _same(one: Alignment, other: Alignment) -> bool:
    """Return whether two alignments match features in the same way."""
    common = int(((one.partner == other.partner) & (one.partner >= 0)).sum())
    return common > SAME * min(one.matches, other.matches)


def _check_enough(of_a: int, of_b: int, options: RegistrationSettings) -> None:
    if min(of_a, of_b) < options.min_matches:
        raise RegistrationError(
            "too_few",
            f"{of_a} and {of_b} point features are too few: at least {options.min_matches} must "
            "agree (min_matches).",
        )


def _too_few(found: str, a: FeatureSet, b: FeatureSet) -> RegistrationError:
    return RegistrationError(
        "too_few", f"of {len(a.xyz)} and {len(b.xyz)} point features, {found}."
    )


def _check_determined(best: Alignment, model: MotionModel, options: RegistrationSettings) -> None:
    """Check that the matches determine the motion in all directions."""
    covariance = covariance_of(best, model)
    for block, limit, what, unit in (
        (slice(0, 3), options.max_sigma, "position", "m"),
        (slice(3, 6), options.max_sigma_rotation, "rotation about the axis", "rad"),
    ):
        values, vectors = np.linalg.eigh(covariance[block, block])
        sigma = float(np.sqrt(values[-1]))
        if sigma > limit:
            axis = ", ".join(
                f"{value:.2f} {name}" for value, name in zip(vectors[:, -1], AXES, strict=True)
            )
            raise RegistrationError(
                "undetermined",
                f"the {best.matches} matched features leave the {what} along ({axis}) open: its "
                f"standard deviation is {sigma:.2g} {unit}, {limit:g} {unit} at most is allowed.",
            )

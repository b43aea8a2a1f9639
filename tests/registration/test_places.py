"""Location recognition: a view finds its place, and what is unsure is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from groundmap import Places, RegistrationError, View, recognise
from groundmap.errors import FileFormatError, InputError
from groundmap.files.archive import write_archive
from registration_scenes import seen_from, street, transform

ALONG = [transform((0.0, 0.0, 1.5 * k)) for k in range(6)]
HERE = transform((0.2, 0.0, 3.7), (0.0, 0.06, 0.0))


def drive_and_view() -> tuple[list[View], View]:
    rng = np.random.default_rng(0)
    points = street(rng, 500)
    view = seen_from(points, HERE, rng)
    return [seen_from(points, pose, rng) for pose in ALONG], view


def test_a_view_is_recognised_without_its_pose() -> None:
    views, view = drive_and_view()
    moved = replace(view, T_map_base=transform((90.0, 0.0, 0.0)))
    found = recognise(moved, Places.of(views))
    np.testing.assert_allclose(found.T_map_base, HERE, atol=0.03)
    assert found.matches > 100
    assert np.linalg.eigvalsh(found.covariance).min() > 0


def test_saved_places_recognise_as_those_in_memory(tmp_path: Path) -> None:
    views, view = drive_and_view()
    places = Places.of(views, spacing=2.0, most_features=200)
    assert len(places.held) == 3
    assert max(len(place.points) for place in places.held) <= 200
    places.save(tmp_path / "places.npz")
    loaded = Places.load(tmp_path / "places.npz")
    one, other = recognise(view, places), recognise(view, loaded)
    assert one.place == other.place
    np.testing.assert_allclose(one.T_map_base, other.T_map_base, atol=1e-3)
    assert not Places([]).held


def test_a_view_from_elsewhere_is_refused() -> None:
    views, _ = drive_and_view()
    rng = np.random.default_rng(9)
    elsewhere = seen_from(street(rng, 500), np.eye(4), rng)
    with pytest.raises(RegistrationError, match="none of the 3 places") as refused:
        recognise(elsewhere, Places.of(views[:3]))
    assert refused.value.reason == "too_few"


def test_two_places_that_look_alike_are_ambiguous() -> None:
    views, view = drive_and_view()
    twins = [views[2], replace(views[2], T_map_base=transform((0.0, 40.0, 0.0)))]
    with pytest.raises(RegistrationError, match=r"two poses that are .* m apart alike") as refused:
        recognise(view, Places.of(twins))
    assert refused.value.reason == "ambiguous"


def test_wrong_arguments_and_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="spacing: expected a number of 0 or more"):
        Places.of([], spacing=-1.0)
    path = tmp_path / "places.npz"
    write_archive(path, {"format": "groundmap-places", "version": 1}, {"xyz": np.zeros((1, 3))})
    with pytest.raises(FileFormatError, match="a complete file of places"):
        Places.load(path)
    arrays = {
        "T_map_camera": np.eye(4)[None],
        "start": np.array([0, 5]),
        "xyz": np.ones((1, 3)),
        "covariance": np.eye(3)[None],
    }
    write_archive(path, {"format": "groundmap-places", "version": 1}, arrays)
    with pytest.raises(FileFormatError, match="ascending numbers from 0 to 1"):
        Places.load(path)

"""Arcs between poses, dashes along them."""

import numpy as np

from bns.viz.paths import arcs, dashes, listed


def test_a_quarter_circle():
    poses = np.array([[0, 0, 0], [1, 1, np.pi / 2]])
    found = arcs(poses, 4)
    assert np.allclose(np.linalg.norm(found[:, :2] - [0, 1], axis=1), 1)
    assert np.allclose(found[2], [np.sin(np.pi / 4), 1 - np.cos(np.pi / 4), np.pi / 4])


def test_arcs_pass_through_the_poses_they_join():
    poses = np.random.default_rng(0).normal(size=(6, 3))
    assert np.allclose(arcs(poses, 5)[::5], poses)


def test_a_straight_line_and_a_full_turn_stay_finite():
    poses = np.array([[0, 0, 0], [1, 0, 0], [1.01, 0, 2 * np.pi]])
    found = arcs(poses, 8)
    assert np.allclose(found[4], [0.5, 0, 0])
    assert np.abs(found[:, :2]).max() < 1.1


def test_listed_stops_at_the_first_gap():
    poses = np.zeros((5, 3))
    poses[3:] = np.nan
    assert len(listed(poses)) == 3
    assert len(listed(np.zeros((5, 3)))) == 5


def test_dashes_cover_half_the_length():
    pieces = dashes(np.array([[0.0, 0.0], [1.0, 0.0]]), dash=0.05)
    assert np.isclose(sum(np.ptp(piece[:, 0]) for piece in pieces), 0.5, atol=0.05)
    assert dashes(np.zeros((3, 2))) == []

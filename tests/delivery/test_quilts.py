"""Quilts: view 0 at the bottom left, going right and then up; and their names."""

import numpy as np
import pytest

from stereo_reproject.delivery import quilts
from stereo_reproject.delivery.displays import DISPLAYS
from stereo_reproject.delivery.quilts import (
    QUILT_FILE,
    Quilt,
    assemble_quilt,
    grid_for,
    quilt_bands,
    quilt_name,
    with_smaller_views,
)

HEIGHT, WIDTH = 3, 2


def numbered(count, *, channels=4):
    """Views of which each pixel holds the view's number, from 1, and its own place."""
    places = np.arange(HEIGHT * WIDTH, dtype=np.float32).reshape(HEIGHT, WIDTH, 1) / 100.0
    return [np.broadcast_to(places + k + 1, (HEIGHT, WIDTH, channels)) for k in range(count)]


@pytest.mark.parametrize(
    ("columns", "rows", "aspect", "name"),
    [
        (8, 6, 0.75, "quilt_qs8x6a0.75"),
        (11, 6, 0.5625, "quilt_qs11x6a0.5625"),
        (7, 7, 16 / 9, "quilt_qs7x7a1.7778"),
        (5, 9, 1.6, "quilt_qs5x9a1.6"),
        (2, 1, 1.0, "quilt_qs2x1a1"),
        (2, 1, 10.0, "quilt_qs2x1a10"),
    ],
)
def test_a_name_tells_grid_and_aspect(columns, rows, aspect, name):
    assert quilt_name(columns, rows, aspect) == name
    assert QUILT_FILE.fullmatch(f"{name}.png")
    assert not QUILT_FILE.fullmatch(f"my_{name}.png")


def test_the_leftmost_view_is_at_the_bottom_left_and_views_go_right_and_then_up():
    quilt = assemble_quilt(numbered(6), 3, 2)
    assert quilt.shape == (2 * HEIGHT, 3 * WIDTH, 4)
    np.testing.assert_array_equal(np.floor(quilt[::HEIGHT, ::WIDTH, 0]), [[4, 5, 6], [1, 2, 3]])


def test_a_view_is_in_its_place_as_it_is():
    views = numbered(6)
    quilt = assemble_quilt(views, 2, 3)
    np.testing.assert_array_equal(quilt[HEIGHT : 2 * HEIGHT, WIDTH:], views[3])


def test_places_without_a_view_are_black():
    views = numbered(4)
    quilt = assemble_quilt(views, 3, 2)
    np.testing.assert_array_equal(quilt[:HEIGHT, WIDTH:], 0.0)
    np.testing.assert_array_equal(quilt[:HEIGHT, :WIDTH], views[3])


def test_bytes_stay_bytes():
    assert assemble_quilt([np.full((2, 2, 3), 7, np.uint8)] * 3, 2, 2).dtype == np.uint8


def test_bands_ask_for_their_own_views_alone():
    asked = []

    class Asked(list):
        def __getitem__(self, k):
            asked.append(k)
            return super().__getitem__(k)

    bands = quilt_bands(Asked(numbered(6)), 3, 2)
    next(bands)
    assert set(asked) == {0, 3, 4, 5}, "the first tells the size of a place"
    np.testing.assert_array_equal(next(bands), assemble_quilt(numbered(6), 3, 2)[HEIGHT:])


def test_bands_of_large_views_are_parts_of_a_row(monkeypatch):
    whole = assemble_quilt(numbered(6), 3, 2)
    monkeypatch.setattr(quilts, "BAND_PIXELS", 3 * 3 * WIDTH)
    bands = list(quilt_bands(numbered(6), 3, 2))
    assert max(len(band) for band in bands) == 3
    np.testing.assert_array_equal(np.concatenate(bands), whole)


@pytest.mark.parametrize(
    ("count", "grid"),
    [(2, (2, 1)), (3, (2, 2)), (30, (6, 5)), (45, (9, 5)), (48, (8, 6)), (49, (7, 7)), (66, (11, 6)), (256, (16, 16))],
)
def test_a_grid_suits_its_views(count, grid):
    assert grid_for(count) == grid


@pytest.mark.parametrize("count", range(2, 257))
def test_each_view_has_a_place_in_a_grid_that_is_no_strip(count):
    columns, rows = grid_for(count)
    assert count <= columns * rows
    assert rows <= columns <= 2 * rows


@pytest.mark.parametrize("display", DISPLAYS.values(), ids=DISPLAYS)
def test_a_movie_has_even_sides_and_views_of_one_pixel_less_at_most(display):
    size = display.view_size(None, None)
    quilt = Quilt(display.columns, display.rows, display.aspect, size)
    assert [side % 2 for side in quilt.movie_size] == [0, 0]
    assert {whole - part for whole, part in zip(size, quilt.movie_view_size, strict=True)} <= {0, 1}


@pytest.mark.parametrize(
    ("grid", "size", "smaller"),
    [((3, 2), (4, 3), (4, 3)), ((3, 2), (5, 3), (4, 3)), ((2, 3), (5, 3), (5, 2)), ((3, 3), (5, 3), (4, 2))],
)
def test_in_a_movie_all_views_lose_the_same_pixels(grid, size, smaller):
    (columns, rows), (width, height) = grid, size
    quilt = Quilt(columns, rows, 1.0, size)
    assert quilt.movie_view_size == smaller
    views = [np.arange(width * height * 4).reshape(height, width, 4) + 1000 * k for k in range(columns * rows)]
    expected = assemble_quilt([view[: smaller[1], : smaller[0]] for view in views], columns, rows)
    np.testing.assert_array_equal(with_smaller_views(assemble_quilt(views, columns, rows), quilt), expected)

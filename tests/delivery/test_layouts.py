from pathlib import Path

import pytest

from stereo_reproject.delivery.layouts import (
    KNOWN_TAGS,
    LAYOUTS,
    contradicting_degrees,
    contradicting_tag,
    name_suffix,
    says,
    tagged_name,
)
from stereo_reproject.delivery.projection import FRONT, WHOLE, MoviePanorama

PART = MoviePanorama(top=0.25)


@pytest.mark.parametrize(
    ("layout", "name", "tagged"),
    [
        ("side-by-side", "film.mp4", "film_LR.mp4"),
        ("side-by-side", "film_lr.mp4", "film_lr.mp4"),
        ("side-by-side", "film-LR-final.mp4", "film-LR-final.mp4"),
        ("side-by-side", "color.mp4", "color_LR.mp4"),
        ("side-by-side", "a.b.mkv", "a.b_LR.mkv"),
        ("side-by-side-half", "film.mkv", "film_HSBS.mkv"),
        ("cross-eyed", "girl.webm", "girl_RL.webm"),
        ("top-bottom", "film.mov", "film_TB.mov"),
        ("top-bottom-half", "film_tb.mov", "film_tb_HTB.mov"),
        ("anaglyph-dubois", "film.mp4", "film.mp4"),
        ("individual", "film.mp4", "film.mp4"),
    ],
)
def test_the_tag_in_the_name(layout, name, tagged):
    path = Path("folder_TB") / name
    assert tagged_name(path, LAYOUTS[layout]) == Path("folder_TB") / tagged


@pytest.mark.parametrize(
    ("layout", "name", "tag"),
    [
        ("side-by-side", "film_LR.mp4", None),
        ("side-by-side", "film_SBS.mp4", None),
        ("side-by-side", "film_HSBS.mp4", "HSBS"),
        ("side-by-side", "film half-SBS.mp4", "half-SBS"),
        ("side-by-side", "film.h.sbs.mp4", "h.sbs"),
        ("side-by-side-half", "film_half_side_by_side.mp4", None),
        ("side-by-side-half", "film_side_by_side.mp4", None),
        ("side-by-side-half", "film_LR.mp4", "LR"),
        ("cross-eyed", "film_LR.mp4", "LR"),
        ("cross-eyed", "film_RL.mp4", None),
        ("top-bottom", "film-ou.mp4", None),
        ("top-bottom", "film_LR_TB.mp4", "LR"),
        ("top-bottom-half", "film.3D.HTAB.mkv", None),
        ("individual", "film_tb.mp4", "tb"),
        ("individual", "table_routine.mp4", None),
        ("anaglyph-red-cyan", "film_SBS.mp4", "SBS"),
        ("interlace-rows", "film_bt.mp4", "bt"),
    ],
)
def test_a_name_that_says_something_else(layout, name, tag):
    assert contradicting_tag(Path("folder_TB") / name, LAYOUTS[layout]) == tag


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_every_name_that_is_made_says_what_it_is(layout):
    path = tagged_name(Path("film.mp4"), layout)
    assert contradicting_tag(path, layout) is None
    assert tagged_name(path, layout) == path
    others = {other.name for other in LAYOUTS.values() if other.tag and other != layout}
    contradicting = {name for name in others if contradicting_tag(path, LAYOUTS[name])}
    assert contradicting == (others if layout.tag else set())


def test_a_layout_has_one_name():
    assert {name: layout.name for name, layout in LAYOUTS.items()} == {name: name for name in LAYOUTS}
    assert set().union(*KNOWN_TAGS.values()) <= LAYOUTS.keys()


@pytest.mark.parametrize(
    ("layout", "panorama", "suffix"),
    [
        ("side-by-side", FRONT, "_180_LR"),
        ("top-bottom", FRONT, "_180_TB"),
        ("side-by-side", WHOLE, "_360_LR"),
        ("top-bottom", WHOLE, "_360_TB"),
        ("side-by-side", PART, "_LR"),
        ("side-by-side", None, "_LR"),
        ("individual", WHOLE, "_360"),
        ("individual", None, ""),
    ],
)
def test_the_tags_of_panoramas(layout, panorama, suffix):
    assert name_suffix(LAYOUTS[layout], panorama) == suffix
    named = tagged_name(Path("film.mp4"), LAYOUTS[layout], panorama)
    assert named == Path(f"film{suffix}.mp4")
    assert tagged_name(named, LAYOUTS[layout], panorama) == named
    assert says(named, LAYOUTS[layout], panorama)
    assert contradicting_tag(named, LAYOUTS[layout]) is None
    assert contradicting_degrees(named, panorama) is None


@pytest.mark.parametrize(
    ("name", "tagged"),
    [
        ("film_LR.mp4", "film_LR_180.mp4"),
        ("film_180.mp4", "film_180_LR.mp4"),
        ("film_180x180_lr.mp4", "film_180x180_lr.mp4"),
        ("film180.mp4", "film180_180_LR.mp4"),
        ("film_360.mp4", "film_360_180_LR.mp4"),
    ],
)
def test_a_tag_that_is_there_already(name, tagged):
    assert tagged_name(Path(name), LAYOUTS["side-by-side"], FRONT) == Path(tagged)


@pytest.mark.parametrize(
    ("name", "panorama", "tag"),
    [
        ("film_180_LR.mp4", FRONT, None),
        ("film-180x180.mp4", FRONT, None),
        ("film_360_LR.mp4", FRONT, "360"),
        ("film_180X180.mp4", WHOLE, "180X180"),
        ("film_360.mp4", PART, "360"),
        ("film_360.mp4", None, "360"),
        ("film_LR.mp4", FRONT, None),
        ("film_1800.mp4", None, None),
    ],
)
def test_a_name_that_says_another_projection(name, panorama, tag):
    assert contradicting_degrees(Path("folder_360_180") / name, panorama) == tag

"""Cryptomatte read back: the material that a hash stands for, and the share of a pixel that it must cover."""

import numpy as np
import pytest

from stereo_reproject.images.effects import Effect
from stereo_reproject.images.effects_pass import effects_pass, material_pass, materials_of
from stereo_reproject.images.passes import MATERIAL_PASS

LAYER = "View Layer"
MIRROR, LEAF = 0xDAA67E50, 0x3F9E2419
MANIFEST = '{"default_surface":"78d05529","a "quoted" one":"daa67e50","leaf":"3f9e2419"}'
ATTRIBUTES = {
    "cryptomatte/0ba5eba/name": "Another.CryptoMaterial",
    "cryptomatte/0ba5eba/manifest": '{"leaf":"00000001"}',
    "cryptomatte/c7dbf5e/name": f"{LAYER}.CryptoMaterial",
    "cryptomatte/c7dbf5e/manifest": MANIFEST,
}
MATERIALS = {'a "quoted" one': Effect.GLOSSY, "leaf": Effect.ALPHA | Effect.BUMP, "not in the picture": Effect.HAIR}


def rank(number):
    return np.array([number], np.uint32).view(np.float32)[0]


def level(*pixels):
    """(1, N, 4): two hashes and their coverages for each pixel."""
    values = [[rank(first), covered, rank(second), also] for first, covered, second, also in pixels]
    return np.array([values], np.float32)


def flags_of(passes, attributes=ATTRIBUTES):
    found = effects_pass(passes, attributes, MATERIALS, layer=LAYER)
    return None if found is None else [Effect(int(value)) for value in found[0, :, 0]]


def test_the_union_of_what_covers_a_tenth():
    image = level(
        (MIRROR, 1.0, 0, 0.0),
        (MIRROR, 0.6, LEAF, 0.4),
        (MIRROR, 0.95, LEAF, 0.05),
        (0x78D05529, 1.0, 0, 0.0),
        (0, 0.0, 0, 0.0),
    )
    both = Effect.GLOSSY | Effect.ALPHA | Effect.BUMP
    assert flags_of({"CryptoMaterial00": image}) == [Effect.GLOSSY, both, Effect.GLOSSY, Effect(0), Effect(0)]


def test_further_levels_count_too():
    passes = {"CryptoMaterial00": level((1, 0.5, 2, 0.3)), "CryptoMaterial01": level((LEAF, 0.2, 0, 0.0))}
    assert flags_of(passes) == [Effect.ALPHA | Effect.BUMP]


def test_other_passes_are_passed_over():
    passes = {"CryptoObject00": level((LEAF, 1.0, 0, 0.0)), "CryptoMaterial00": level((MIRROR, 1.0, 0, 0.0))}
    assert flags_of(passes) == [Effect.GLOSSY]


def test_pixels_of_the_same_materials_have_the_same_number():
    pixels = (MIRROR, 1.0), (LEAF, 0.6, MIRROR, 0.4), (MIRROR, 0.95, LEAF, 0.05), (MIRROR, 0.5, LEAF, 0.4), (0, 0.0)
    found = material_pass({"CryptoMaterial00": level(*((*pixel, 0, 0.0)[:4] for pixel in pixels))})
    assert found is not None
    assert found.shape == (1, 5, 1)
    mirror, both, hardly_both, again_both, nothing = found[0, :, 0]
    assert mirror == hardly_both
    assert both == again_both
    assert len({mirror, both, nothing}) == 3
    assert materials_of({MATERIAL_PASS: found})[0, 1] == both


def test_a_material_on_a_further_level_makes_another_number():
    first = level((MIRROR, 0.5, 0x78D05529, 0.3), (MIRROR, 0.5, 0x78D05529, 0.3))
    further = level((LEAF, 0.2, 0, 0.0), (LEAF, 0.02, 0, 0.0))
    found = material_pass({"CryptoMaterial01": further, "CryptoMaterial00": first})
    assert found is not None
    assert found[0, 0, 0] != found[0, 1, 0]


def test_without_a_cryptomatte_no_material_is_known():
    assert material_pass({"Combined": np.zeros((1, 4, 4), np.float32)}) is None
    assert materials_of({"Combined": np.zeros((1, 4, 4), np.float32)}) is None


@pytest.mark.parametrize(
    ("names", "attributes"),
    [
        (["CryptoMaterial00"], {}),
        (["CryptoMaterial00"], {"cryptomatte/c7dbf5e/name": f"{LAYER}.CryptoMaterial"}),
        (["CryptoObject00"], ATTRIBUTES),
    ],
    ids=["no cryptomatte", "no manifest", "no pass"],
)
def test_where_nothing_says_whose_a_hash_is_there_is_no_pass(names, attributes):
    assert flags_of({name: level((LEAF, 1.0, 0, 0.0)) for name in names}, attributes) is None

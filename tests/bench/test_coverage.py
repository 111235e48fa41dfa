"""The statistics behind the coverage script: the true excess of a picture from plain renders, and its own error."""

import json

import numpy as np
import pytest

from tests.bench.coverage import Run, parse, stored, summary
from tests.bench.truth import References, binomial_interval

SIZE = (36, 48)
"""(H, W)"""

RENDERS = 16
"""So few that a mean of them is clearly not the truth: taking it for that would tell 1 / 16 too little."""

ERRORS = 4.0
"""Standard errors within which a mean is taken for right."""

REPEATS = 40

FROM_EIGHT_GROUPS = (0.75, 1.7)
"""Root mean square of (told - true) / error over the repeats. An error from 8 groups is itself uncertain by 27 %: about
1.18 is due (Student's t with 7 degrees of freedom), and 40 repeats move it by some 0.15."""


class Scene:
    """Tone-mapped colours with a known mean and a variance that differs from pixel to pixel."""

    def __init__(self, seed=1):
        self.rng = np.random.default_rng(seed)
        self.mean = self.rng.uniform(0.35, 0.65, (*SIZE, 3))
        self.reach = self.rng.uniform(0.0, 0.2, (*SIZE, 1))

    def render(self, bias=0.0, share=1.0):
        """Scene-linear, opaque colours (H, W, 4) of a render with `share` of the noise, and wrong by `bias`."""
        toned = self.mean + bias + share * self.reach * self.rng.uniform(-1.0, 1.0, self.mean.shape)
        return np.concatenate([toned / (1.0 - toned), np.ones((*SIZE, 1))], axis=-1)

    def noise_excess(self, picture):
        """The true noise_ratio^2 - 1 of this very picture: the variance of the even distribution is known."""
        variance = np.mean(self.reach**2) / 3.0
        toned = picture[..., :3] / (1.0 + picture[..., :3])
        return (np.mean((toned - self.mean) ** 2) + variance) / (2.0 * variance) - 1.0

    def excess(self, picture, share):
        """The true bias^2 / 2 of a picture with `share` of a render's noise."""
        return self.noise_excess(picture) + (1.0 - share**2) / 2.0

    def references(self, renders=RENDERS):
        result = References.none(SIZE[1], SIZE[0])
        for _ in range(renders):
            result.add(self.render())
        return result


@pytest.mark.parametrize(("bias", "share"), [(0.0, 1.0), (0.0, 0.5), (0.03, 0.8), (0.1, 1.0)])
def test_the_excess_is_right_on_average_and_within_the_error_that_it_tells(bias, share):
    scene = Scene()
    z = []
    for _ in range(REPEATS):
        picture = scene.render(bias, share)
        truth = scene.references().truth(picture, share**2)
        z.append((truth.excess - scene.excess(picture, share)) / truth.standard_error)
        assert truth.excess - truth.smoothed == pytest.approx(scene.noise_excess(picture), abs=0.05)
    low, high = FROM_EIGHT_GROUPS
    rms = np.sqrt(np.mean(np.square(z)))
    assert low < rms < high
    assert abs(np.mean(z)) < ERRORS * rms / np.sqrt(REPEATS)


def test_sums_by_group_lose_nothing_and_come_back_from_a_file(tmp_path):
    scene = Scene()
    renders = [scene.render() for _ in range(RENDERS)]
    references = References.none(SIZE[1], SIZE[0])
    for render in renders:
        references.add(render)
    ours = scene.render(0.02)
    toned = np.array([render / (1.0 + render) for render in renders])
    error = np.mean([np.mean((ours / (1.0 + ours) - one) ** 2) for one in toned])
    pairs = [np.mean((a - b) ** 2) for i, a in enumerate(toned) for b in toned[:i]]
    assert references.truth(ours, 1.0).excess == pytest.approx(error / np.mean(pairs) - 1.0, abs=1e-5)
    # Noise that ours is said not to have is taken for its bias.
    assert references.truth(ours, 0.5).excess == pytest.approx(error / np.mean(pairs) - 0.75, abs=1e-5)
    assert references.truth(ours, 0.5).noise_ratio == pytest.approx(references.truth(ours, 1.0).noise_ratio, abs=1e-5)
    references.save(tmp_path / "stored.npz")
    assert References.load(tmp_path / "stored.npz").truth(ours, 0.5) == references.truth(ours, 0.5)
    assert [path.name for path in tmp_path.iterdir()] == ["stored.npz"]


def run(excess, low, high, error=0.0, estimate=1.0):
    return Run("scene", "balanced", 1, 0.1, estimate, low, high, float(np.sqrt(1.0 + excess)), excess, error)


def test_a_run_is_covered_by_its_own_interval_only():
    assert not run(0.22, 1.0, 1.1).covered
    assert not run(0.22, 1.0, 1.1, error=0.02).covered
    assert run(0.22, 1.0, 1.1, error=0.02).nearly_covered
    assert not run(0.22, 1.0, 1.1, error=0.005).nearly_covered
    assert run(0.2, 1.0, 1.1).covered
    assert not run(-0.2, 1.0, 1.1).covered


def test_z_is_in_deviations_of_the_estimate():
    half = 0.2
    told = run(0.0, np.sqrt(1.1 - half), np.sqrt(1.1 + half), estimate=np.sqrt(1.1))
    assert told.z == pytest.approx(0.1 / (half / 1.96))
    assert np.isnan(run(0.0, 1.0, 1.0).z)


def test_a_run_without_an_estimate_is_told_and_not_counted():
    none = Run("scene", "balanced", 2, 1.0)
    assert summary("scene", [run(0.0, 0.9, 1.1), none]).startswith("scene: 1 of 1 covered, 100 %")
    assert summary("scene", [run(0.0, 0.9, 1.1), none]).endswith("1 without an estimate")
    assert summary("scene", [none]) == "scene: nothing to count; 1 without an estimate"


def test_a_run_without_an_estimate_can_be_written_as_json():
    fields = stored(Run("scene", "balanced", 2, 1.0))
    assert fields["estimate"] is fields["low"] is fields["z"] is None
    assert fields["covered"] is False
    assert json.loads(json.dumps(fields, allow_nan=False)) == fields


@pytest.mark.parametrize(("hits", "trials"), [(0, 40), (36, 40), (40, 40), (5, 10)])
def test_the_binomial_interval_ends_where_the_hits_are_1_96_deviations_away(hits, trials):
    for end in binomial_interval(hits, trials):
        deviation = np.sqrt(end * (1.0 - end) / trials)
        assert abs(hits / trials - end) == pytest.approx(1.96 * deviation, abs=1e-9)


def test_an_unknown_scene_is_refused(capsys):
    with pytest.raises(SystemExit) as ended:
        parse(["--scenes", "anywhere", "no-such-scene"])
    assert ended.value.code == 2
    assert "unknown scene 'no-such-scene'" in capsys.readouterr().err

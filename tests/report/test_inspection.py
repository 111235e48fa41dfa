"""The table that `inspect` prints, and the rows of its JSON."""

from stereo_reproject.images.effects import HANDLING, NOT_CALLED_FOR, Effect, EffectsPlan, Finding
from stereo_reproject.report.inspection import effects_rows, format_inspection

MANY = tuple(f"material 'leaf' on 'tree {number}'" for number in range(39))


def plan():
    def finding(effect):
        by = MANY if effect == Effect.ALPHA else ()
        return Finding(effect, by, HANDLING[effect] if by else NOT_CALLED_FOR)

    return EffectsPlan(tuple(finding(effect) for effect in Effect), {"leaf": Effect.ALPHA})


def inspection(**changes):
    return {
        "scene": "forest",
        "frame": 3,
        "size": [640, 360],
        "samples": 16,
        "engine": "CYCLES",
        "device": "CPU",
        "accuracy": "balanced",
        "effects": effects_rows(plan()),
        "passes": ["Combined", "Depth"],
        "predicted": {
            "rests_on": "sketches",
            "source_seconds": 12.34,
            "denoise_seconds": 0.0,
            "warp_seconds": 0.5,
            "fill": {"method": "packed", "reason": "cheapest", "seconds": 2.0},
            "refine_seconds": {"low": 0.0, "high": 4.0},
            "total_seconds": {"low": 14.84, "high": 18.84},
            "multiview_seconds": 24.0,
            "gain": {"low": 1.27, "high": 1.62},
            "fractions": {"holes": 0.1, "probes": 0.03},
        },
        **changes,
    }


def test_a_row_for_each_effect():
    rows = effects_rows(plan())
    assert [row["effect"] for row in rows] == [effect.label for effect in Effect]
    assert [row["effect"] for row in rows if row["called_for"]] == ["alpha"]
    row = next(row for row in rows if row["called_for"])
    assert row["by"] == list(MANY)
    assert row["handling"] == HANDLING[Effect.ALPHA]


def test_the_table_names_the_first_two_and_counts_the_others():
    table = format_inspection(inspection())
    assert "material 'leaf' on 'tree 0', material 'leaf' on 'tree 1' and 37 more" in table
    assert "tree 2" not in table
    assert HANDLING[Effect.ALPHA] in table
    assert table.isascii()


def test_the_table_lists_what_is_not_called_for():
    line = next(line for line in format_inspection(inspection()).splitlines() if line.startswith("not called for"))
    assert "glossy" in line
    assert "alpha" not in line


def test_the_table_says_that_its_figures_are_predicted():
    table = format_inspection(inspection())
    assert "predicted     not measured; from sketches" in table
    assert "14.8 to 18.8 s" in table
    assert "1.27 to 1.62 x over Blender's multiview" in table


def test_a_plan_alone_predicts_nothing():
    table = format_inspection(inspection(predicted=None))
    assert "no sketch was asked for" in table
    assert "gain" not in table


def test_where_only_the_gain_is_known():
    fill = {"method": "full", "reason": "the scene renders with EEVEE", "seconds": None}
    whole = {"rests_on": "how it is done", "fill": fill, "total_seconds": None, "gain": {"low": 1.0, "high": 1.0}}
    table = format_inspection(inspection(predicted=whole))
    assert "full: the scene renders with EEVEE" in table
    assert "1.00 x over" in table
    assert " to " not in table.splitlines()[-1]


def test_a_share_of_the_picture_is_told():
    effects = effects_rows(plan())
    next(row for row in effects if row["called_for"]).update(share=0.25, seconds_at_most=7.0)
    assert "25.0 % of the picture at most: at most 7.0 s" in format_inspection(inspection(effects=effects))

"""Operators that measure how deep the scene is and fit that depth to the screen and the viewer."""

from __future__ import annotations

import bpy

from ..stereo_reproject.blender.scene.depth import EDGE_ROWS, measure_depth
from ..stereo_reproject.blender.scene.rig import convergence_of_screen, frame_region, stereo_cameras
from ..stereo_reproject.errors import BadInputError
from ..stereo_reproject.views.comfort import BROADCAST, Fit, Limits, fit_limits, fit_off_axis, fit_parallel, unit_width
from ..stereo_reproject.views.depth_range import MIN_CUT_PERCENT, cut_in_front
from ..stereo_reproject.words import Words
from .lengths import length_words
from .results import KnownDepth, result_of
from .stereo import EditsCamera, check_editable, check_screen, parallax_now, viewing_conditions
from .text import reported, sentence, shown

BEHIND_FOR_CUT = "{line}; all is behind the screen, whose edge would cut {name} (Avoid Cuts)"
"""Report of a fit that places all behind the screen, which must fit into the status bar."""

MAX_INTEROCULAR = 100.0
"""Interocular distance, in scene units, up to which Blender's own setting goes."""


class STEREO_REPROJECT_OT_measure_depth(bpy.types.Operator):
    """Measure the nearest and farthest depth that the camera sees, by ray casts; nothing is rendered"""

    bl_idname = "stereo_reproject.measure_depth"
    bl_label = "Measure Depth"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a camera for stereo."""
        try:
            check_screen(context.scene)
        except BadInputError as error:
            cls.poll_message_set(sentence(shown(error)))
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Measure the depth that the camera sees now, and keep it for the panel."""
        try:
            measure(context)
        except BadInputError as error:
            self.report({"ERROR"}, sentence(reported(error)))
            return {"CANCELLED"}
        self.report({"INFO"}, sentence(reported(parallax_line(context.scene))))
        return {"FINISHED"}


def measure(context: bpy.types.Context) -> KnownDepth:
    """Measure the depth that the scene's camera sees now, keep it for the panel, and return it. Raises BadInputError
    where nothing is in front of the camera.
    """
    scene = context.scene
    check_screen(scene)
    (near, far), edges = measure_depth(scene, context.evaluated_depsgraph_get())
    result_of(scene).depth = known = KnownDepth(near, far, scene.frame_current, edges, camera_state(scene))
    return known


def camera_state(scene: bpy.types.Scene) -> tuple[float, ...]:
    """Return the numbers that decide what the scene's camera sees of a scene that stands still: its pose and lens."""
    camera = scene.camera
    return *(value for row in camera.matrix_world for value in row), camera.data.lens


def side_words(percent: float) -> str:
    """Return a parallax in percent of the width as words: how much, and on which side of the screen."""
    if abs(percent) < 0.05:
        return Words("at the screen")
    message = "{percent} % behind" if percent > 0.0 else "{percent} % in front"
    return Words(message, percent=f"{abs(percent):.1f}")


def parallax_line(scene: bpy.types.Scene) -> str:
    """Return the parallax of the nearest and farthest point as one line; "" where it is not known."""
    sides = [side_words(found.percent) for _, found in parallax_now(scene)]
    return Words("nearest {nearest}, farthest {farthest}", nearest=sides[0], farthest=sides[1]) if sides else ""


class STEREO_REPROJECT_OT_fit_to_comfort(EditsCamera, bpy.types.Operator):
    """Set interocular and convergence distance so that all that the camera sees is comfortable to look at, on the
    screen and for the viewer that are set under Advanced"""

    bl_idname = "stereo_reproject.fit_to_comfort"
    bl_label = "Fit to Comfort"
    bl_options = {"REGISTER", "UNDO"}

    in_front: bpy.props.FloatProperty(
        name="In Front (%)",
        description="Parallax of the nearest point in front of the screen, in percent of the width, as far as that is"
        " comfortable",
        default=-BROADCAST.near,
        min=0.0,
        soft_max=3.0,
        precision=1,
        step=10,
        options={"SKIP_SAVE"},
    )
    behind: bpy.props.FloatProperty(
        name="Behind (%)",
        description="Parallax of the farthest point behind the screen, in percent of the width, as far as that is"
        " comfortable",
        default=BROADCAST.far,
        min=0.0,
        soft_max=3.0,
        precision=1,
        step=10,
        options={"SKIP_SAVE"},
    )

    avoid_cuts: bpy.props.BoolProperty(
        name="Avoid Cuts",
        description="Show everything behind the screen if the frame's left or right edge would cut something in front"
        " of it",
        default=True,
        options={"SKIP_SAVE"},
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Measure the scene's depth, and set the camera to show it between both limits."""
        scene = context.scene
        try:
            data = check_editable(scene).data
            fit, cut = self._fit(context, data)
        except BadInputError as error:
            self.report({"ERROR"}, sentence(reported(error)))
            return {"CANCELLED"}
        data.stereo.interocular_distance = fit.interocular
        if data.stereo.convergence_mode == "OFFAXIS":
            data.stereo.convergence_distance = convergence_of_screen(data, fit.screen_depth)
        set_to = {
            "length": length_words(scene, fit.interocular),
            "distance": length_words(scene, data.stereo.convergence_distance),
        }
        message = "Interocular {length}, convergence {distance}: {parallax}"
        if data.stereo.convergence_mode == "PARALLEL":
            message = "Interocular {length}: {parallax}"
        line = Words(message, **set_to, parallax=parallax_line(scene))
        if cut is not None:
            line = Words(BEHIND_FOR_CUT, line=line, name=repr(cut))
        result = result_of(scene)
        result.fitted, result.fitted_to = line, distances_of(data)
        self.report({"INFO"}, reported(line))
        return {"FINISHED"}

    def _fit(self, context: bpy.types.Context, data: bpy.types.Camera) -> tuple[Fit, str | None]:
        """Return the stereo settings that fit the scene as it is now, and the name of what the frame would cut in front
        of the screen, for which all is placed behind it; None if there is nothing. Raises BadInputError where no
        settings fit.
        """
        refuse_what_cannot_be_fitted(data)
        if self.in_front + self.behind == 0.0:
            raise BadInputError("no depth is left: raise In Front or Behind")
        scene = context.scene
        known, viewing = measure(context), viewing_conditions(scene)
        eyes = stereo_cameras(scene.camera, scene.render)
        width = unit_width(eyes["left"], frame_region(scene.render).full_width)
        limits = fit_limits(viewing, Limits(-self.in_front, self.behind))
        avoided = None
        if data.stereo.convergence_mode == "PARALLEL":
            fit = fit_parallel(known.near, limits, width)
        else:
            fit = fit_off_axis(known.near, known.far, limits, width, viewing.eyes_percent)
            cut = cut_in_front(known.edges, fit.depth_at(-MIN_CUT_PERCENT, width), EDGE_ROWS)
            if cut and self.avoid_cuts and limits.far > 0.0:
                limits, avoided = Limits(0.0, limits.far), cut[0][0]
                fit = fit_off_axis(known.near, known.far, limits, width, viewing.eyes_percent)
        if fit.interocular > MAX_INTEROCULAR:
            raise BadInputError(
                Words(
                    "the eyes would be {length} units apart, which Blender does not allow",
                    length=f"{fit.interocular:.0f}",
                )
            )
        return fit, avoided


def distances_of(data: bpy.types.Camera) -> tuple[float, float]:
    """Return a camera's interocular and convergence distance, in scene units."""
    return data.stereo.interocular_distance, data.stereo.convergence_distance


def refuse_what_cannot_be_fitted(data: bpy.types.Camera) -> None:
    """Raise BadInputError for cameras in which interocular and convergence distance do not determine the parallax."""
    if data.type == "ORTHO":
        raise BadInputError("an orthographic camera shows all depths alike: make it perspective to fit it")
    if data.stereo.convergence_mode == "TOE":
        raise BadInputError("toe-in has other parallax at the sides of the picture: set the mode to Off-Axis to fit it")

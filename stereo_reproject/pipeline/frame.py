"""START HERE: the way of a frame. Render one eye, warp it, trace the holes, put the other eye together."""

from __future__ import annotations

from collections.abc import Callable

from ..settings.accuracy import Accuracy, accuracy_of
from ..settings.frame import StereoSettings
from ..trace.costs import TraceCosts
from ..trace.fill import check_fill
from .finishing import Completed, composited, denoised, finished_frame
from .renderer import Renderer
from .shared_findings import SharedFindings
from .source import Source, render_source
from .stages import Stage
from .stereo_frame import StereoFrame
from .stopwatch import Stopwatch
from .task import FrameTask
from .warping import show_target, warp_source


def render_stereo_frame(
    renderer: Renderer,
    settings: StereoSettings,
    *,
    accuracy: Accuracy | None = None,
    findings: SharedFindings | None = None,
    watch: Stopwatch | None = None,
    known_costs: Callable[[], TraceCosts] = TraceCosts,
    on_source: Callable[[Source], None] | None = None,
) -> StereoFrame:
    """Render the stereo pair of the renderer's scene and frame, and return it.

    accuracy takes the place of the one that the settings name, for a picture of `SettingsTuning.unscaled_picture_px`;
    findings are those of other frames of the same animation. The watch measures the stages: look, source,
    denoise_source, warp, pilot, fill, refine, composite, denoise_target, and account, which comes after the pair is
    finished; look and account are not in the total. Stages that it has seen before, such as the renderer's plan, are in
    the seconds and the total too. Its onlooker is shown the eyes as they are made, which changes none of their pixels.
    known_costs returns the costs of tracing as far as they are known, by default the assumed ones; it is asked once the
    source is rendered and warped. on_source is handed the source, of which other frames can be made. Raises
    BadInputError when the settings cannot be met for this scene, and StereoReprojectError when a render fails.
    """
    watch = watch or Stopwatch()
    task = FrameTask.of_pair(renderer, settings, findings or SharedFindings(), known_costs, watch)
    check_fill(settings.fill, renderer.fill_blockers())

    source = render_source(task, accuracy or accuracy_of(settings), for_later=on_source is not None)
    if on_source is not None:
        on_source(source)

    watch.lap(Stage.WARP)
    warped = warp_source(task, source)
    source, tracing = source.for_users(), warped.tracing
    show_target(task, source, warped, holes=warped.target.reprojection.reasons > 0)
    if tracing.wants_pilot:
        watch.lap(Stage.PILOT)
        tracing.send_pilot()

    watch.lap(Stage.FILL)
    fill = tracing.fill()
    show_target(task, source, warped)

    watch.lap(Stage.REFINE)
    refinement = tracing.refine()
    if refinement.pixels.any():
        show_target(task, source, warped)

    watch.lap(Stage.COMPOSITE)
    done = Completed((source,), warped.target, tracing.target, fill, refinement)
    finished = composited(task, done)
    if source.denoising is not None:
        watch.lap(Stage.DENOISE_TARGET)
        finished = denoised(done, finished, source.denoising)

    watch.lap(Stage.ACCOUNT)
    return finished_frame(task, warped, done, finished)

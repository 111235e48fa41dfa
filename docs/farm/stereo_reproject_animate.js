// SPDX-License-Identifier: GPL-3.0-or-later
// A stereo animation as a job type of Flamenco 3. README.md beside this file says where it goes.
//
// Each task runs the one command that can be run again at any time: `animate ... --resume` renders what is missing and
// leaves alone what is there. A task that Flamenco gives to another worker renders no frame for nothing.

const JOB_TYPE = {
    label: "Stereo Animation",
    description: "Both eyes of an animation with Stereo Reproject, then the movie and the charts",
    settings: [
        {
            key: "frames", type: "string", required: true,
            eval: "f'{C.scene.frame_start}-{C.scene.frame_end}'",
            evalInfo: { showLinkButton: true, description: "Frames of the scene" },
            description: "Frames to render: 47 or 1-30, or several such with commas between them",
        },
        {
            key: "chunk_size", type: "int32", default: 8, propargs: { min: 1 }, visible: "submission",
            description: "How many frames one task renders; Blender starts once a task",
        },
        {
            key: "accuracy", type: "string", required: true, default: "balanced",
            choices: ["draft", "preview", "balanced", "high", "exact"],
            description: "What is promised of the other eye",
        },
        {
            key: "samples", type: "int32", default: 0, propargs: { min: 0 },
            description: "Samples per pixel; 0 for those of the scene",
        },
        {
            key: "layout", type: "string", default: "",
            description: "How both eyes lie in the files, one of `animate --layout`; empty for what it does without it",
        },
        {
            key: "movie", type: "string", default: "movie.mp4",
            description: "Name of the movie in the output folder; empty for none",
        },
        {
            key: "strict", type: "bool", default: true, visible: "submission",
            description: "Fail where the scene is known to lack anything, such as a library or a texture, instead of "
                + "rendering without it",
        },
        {
            key: "extra_options", type: "string", default: "",
            description: 'More options of `animate`, "in quotes" where one has spaces',
        },
        {
            key: "render_output_root", type: "string", subtype: "dir_path", required: true, visible: "submission",
            description: "Folder that all workers share; the job's own folder is made in it",
        },
        {
            key: "render_output_path", type: "string", subtype: "dir_path", required: true,
            eval: "str(Path(bpy.path.abspath(settings.render_output_root)) / jobname / '{timestamp}')",
            description: "Folder of the frames. Without {timestamp} a second job goes on where the first one ended",
        },

        // Set by Flamenco's add-on.
        { key: "blendfile", type: "string", required: true, visible: "web", description: "The scene" },

        // What starts the program on a worker.
        { key: "command", type: "string", default: "{blender} --command stereo_reproject", visible: "hidden" },
    ],
};

// Far more than any animation has: one chunk then holds all frames.
const EVERY_FRAME = 1000000000;

function compileJob(job) {
    const settings = job.settings;
    settings.render_output_path = settings.render_output_path.replace("{timestamp}", formatTimestampLocal(job.created));

    const lastTask = finishTask(settings);
    for (const chunk of frameChunker(settings.frames, settings.chunk_size)) {
        const task = animateTask(`render-${chunk}`, settings, chunk);
        job.addTask(task);
        lastTask.addDependency(task);
    }
    job.addTask(lastTask);
}

// The same command over all frames finds them all there, and makes the movie and the charts.
function finishTask(settings) {
    const allFrames = frameChunker(settings.frames, EVERY_FRAME)[0];
    const movie = settings.movie ? ["--movie", path.join(settings.render_output_path, settings.movie)] : [];
    return animateTask("movie-and-charts", settings, allFrames, movie);
}

function animateTask(name, settings, frames, more = []) {
    const [program, ...options] = words(settings.command);
    const args = [...options, ...animateArguments(settings, frames), ...more];
    const task = author.Task(name, "blender");
    task.addCommand(author.Command("exec", { exe: program, args: args }));
    return task;
}

// Each is one argument of the program, whatever is in it: no shell reads them.
function animateArguments(settings, frames) {
    return [
        "animate", settings.blendfile,
        "--output", settings.render_output_path,
        "--frames", frames,
        "--resume",
        "--accuracy", settings.accuracy,
        ...(settings.samples > 0 ? ["--samples", String(settings.samples)] : []),
        ...(settings.layout ? ["--layout", settings.layout] : []),
        ...(settings.strict ? ["--strict"] : []),
        ...words(settings.extra_options),
    ];
}

// 'a "b c"' is ["a", "b c"].
function words(text) {
    return ((text || "").match(/"[^"]*"|\S+/g) || []).map((word) => word.replace(/^"(.*)"$/, "$1"));
}

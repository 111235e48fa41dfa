// What Flamenco's Manager gives a job compiler script, and nothing more: https://flamenco.blender.org/usage/job-types/
//
//   node flamenco_manager.js SCRIPT < job.json
//
// Prints {jobType, tasks}. Whatever a script reads, calls or sets that the Manager does not have is an error.
"use strict";

const fs = require("fs");
const vm = require("vm");

// Only what `members` has, and settable only what `writable` names.
function strict(what, members, writable = []) {
    return new Proxy(members, {
        get(target, name) {
            const asked = typeof name === "symbol" || name === "toJSON"; // by JSON.stringify and the language itself
            if (asked || Object.hasOwn(target, name)) return target[name];
            throw new Error(`${what} has no ${name}`);
        },
        set(target, name, value) {
            if (!writable.includes(name)) throw new Error(`${what}.${String(name)} cannot be set`);
            target[name] = value;
            return true;
        },
    });
}

function task(name, type) {
    if (!name || !type) throw new Error("author.Task(name, type): both are required");
    const made = { name, type, commands: [], dependencies: [] };
    made.addCommand = (command) => void made.commands.push(command);
    made.addDependency = (other) => void made.dependencies.push(other.name);
    return strict("a task", made);
}

function explode(range) {
    const frames = new Set();
    for (const part of range.replaceAll("..", "-").split(",")) {
        const ends = part.split("-").map((text) => {
            if (!/^\s*\d+\s*$/.test(text)) throw new Error(`invalid range "${range}": ${part}`);
            return Number(text);
        });
        if (ends.length > 2) throw new Error(`invalid range "${range}": ${part}`);
        for (let frame = ends[0]; frame <= ends.at(-1); frame++) frames.add(frame);
    }
    return [...frames].sort((a, b) => a - b);
}

// [1, 2, 5, 6, 7] is "1,2,5-7".
function merge(frames) {
    const runs = [];
    for (const frame of frames) {
        if (runs.length && runs.at(-1).at(-1) === frame - 1) runs.at(-1).push(frame);
        else runs.push([frame]);
    }
    return runs.map((run) => (run.length > 2 ? `${run[0]}-${run.at(-1)}` : run.join(","))).join(",");
}

function frameChunker(range, size) {
    if (!Number.isInteger(size) || size < 1) throw new Error(`invalid chunk size, must be positive number: ${size}`);
    const frames = explode(range);
    const chunks = [];
    for (let start = 0; start < frames.length; start += size) chunks.push(merge(frames.slice(start, start + size)));
    return chunks;
}

const ignored = () => undefined;
const documented = {
    author: strict("author", {
        Task: task,
        Command: (name, parameters) => ({ name, parameters }),
    }),
    path: strict("path", {
        join: (...parts) => parts.join("/").replace(/\/+/g, "/"),
        basename: (of) => of.split("/").at(-1),
        dirname: (of) => of.split("/").slice(0, -1).join("/"),
        stem: (of) => of.split("/").at(-1).replace(/\.[^.]*$/, ""),
    }),
    frameChunker,
    formatTimestampLocal: (time) => time.toISOString().slice(0, 19).replace("T", "_").replaceAll(":", ""),
    print: ignored,
    alert: ignored,
};

// The language itself: no require, no process, and no console.
const manager = vm.createContext(documented);
vm.runInContext("delete globalThis.console", manager);
vm.runInContext(fs.readFileSync(process.argv[2], "utf8"), manager, { filename: process.argv[2] });
const jobType = vm.runInContext("JOB_TYPE", manager);

const submitted = JSON.parse(fs.readFileSync(0, "utf8"));
const keys = jobType.settings.map((setting) => setting.key);
const unset = Object.fromEntries(keys.map((key) => [key, undefined]));
const tasks = [];
const job = strict("job", {
    name: submitted.name,
    created: new Date(submitted.created),
    settings: strict("settings", { ...unset, ...submitted.settings }, keys),
    addTask: (added) => void tasks.push(added),
});
manager.compileJob(job);
process.stdout.write(JSON.stringify({ jobType, tasks }));

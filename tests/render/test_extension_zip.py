"""The zip itself: what is in it, that Blender installs and enables it, and every operator run through what was
installed, on a real scene."""

import ast
import json
import os
import platform
import re
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from pathlib import Path

import OpenEXR
import pytest

from stereo_reproject.sequence.journal_folder import JOURNAL

ROOT = Path(__file__).resolve().parents[2]
DRIVER = Path(__file__).with_name("extension_driver.py")
DEMO = ROOT / "demo" / "cornell-box" / "cornell-box.blend"

SIZE = (96, 54)
"""What the driver sets."""
SIZE_OF_PREVIEW = (480, 270)
"""Half of what the driver sets for a preview."""

BUILD_SECONDS = 300.0
"""With all wheels to be downloaded over a slow line."""
SECONDS = 120.0
"""Far more than any of the driver's tasks takes."""

PLATFORM = {"linux": "linux", "darwin": "macos", "win32": "windows"}.get(sys.platform, sys.platform)
MACHINE = {"x86_64": "x64", "amd64": "x64", "aarch64": "arm64"}.get(platform.machine().lower(), platform.machine())

SHIPPED_FILES = {
    "__init__.py",
    "LICENSE",
    "blender_manifest.toml",
    "docs/farm/README.md",
    "docs/farm/stereo-animation.openjd.yaml",
    "docs/farm/stereo_reproject_animate.js",
}
MAX_PAGES_BYTES = 4_000_000
"""Of the pages of the manual and their pictures, which most users never open: less than the wheels take."""
SHIPPED_FOLDERS = ("operators", "stereo_reproject")
SHIPPED_KINDS = (".py", ".osl")

NEVER_IMPORTED = {"ensurepip", "ftplib", "http", "pip", "requests", "site", "socket", "ssl", "urllib", "urllib3"}
"""An extension brings its libraries as wheels, and asks for the permission "files" alone: no network."""

HARMLESS = (
    # What the installer and the operators are meant to say.
    r'STATUS Installed "stereo_reproject"',
    r"Info: .*",
    # The Cornell box asks for denoising.
    r"(Info: )?Denoising completed",
    # Of a denoiser that looks for a graphics card, on a machine without one.
    r".* cycles +\| WARNING CUEW initialization failed: .*",
    # Blender's log of files that it reads and writes.
    r'(\d\d:\d\d\.\d+ +blend +\| )?(Read blend|Writing userprefs|Writing user preferences): ".*".*',
    # The Cornell box was saved by a newer Blender than 4.5, whose editors this one does not know.
    r'Warning: region type \d+ missing in space type "\w+" \(id: \d+\) - removing region',
    r"regiondata free error",
    r"Warning: File written by newer Blender binary \(\d+\.\d+\), expect loss of data!",
    # After a plain multiview render as well, 4.5 looks for a file without a view's suffix when it has saved the result.
    r"Error: Image 'Render Result' could not be saved to '.*'",
)


def build(folder):
    command = [sys.executable, str(ROOT / ".ci" / "extension.py"), "--output", str(folder)]
    built = subprocess.run(command, capture_output=True, text=True, timeout=BUILD_SECONDS, check=False)
    if built.returncode == 0:
        return
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    if not all((ROOT / wheel).exists() for wheel in manifest["wheels"]):
        pytest.skip(f"the wheels for the zip could not be downloaded: {built.stderr[-400:]}")
    pytest.fail(f"no zip could be built: {built.stdout}{built.stderr}")


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """The zip for the platform that the tests run on."""
    folder = tmp_path_factory.mktemp("zips")
    build(folder)
    (path,) = folder.glob(f"stereo_reproject-*-{PLATFORM}_{MACHINE}.zip")
    return path


class Blender:
    """Has the driver do something in a Python of its own, whose Blender knows of no user folder but this one."""

    def __init__(self, folder):
        self.user, self.temporary, self._elsewhere = (folder / name for name in ("user", "temporary", "elsewhere"))
        for made in (self.user, self.temporary, self._elsewhere):
            made.mkdir()

    def do(self, task, **given):
        """The driver's facts, and under "said" the other lines that it and Blender printed."""
        environment = {name: value for name, value in os.environ.items() if not name.startswith(("BLENDER_", "PYTHON"))}
        environment["BLENDER_USER_RESOURCES"] = str(self.user)
        environment |= dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(self.temporary))
        ran = subprocess.run(
            # Not from the checkout: nothing of it must be found there by chance.
            [sys.executable, "-W", "default", str(DRIVER), json.dumps({"do": task, **given})],
            cwd=self._elsewhere,
            env=environment,
            capture_output=True,
            text=True,
            encoding="utf-8",
            timeout=SECONDS,
            check=False,
        )
        assert ran.returncode == 0, ran.stdout + ran.stderr
        *said, facts = ran.stdout.splitlines()
        return json.loads(facts) | {"said": [line for line in (*said, *ran.stderr.splitlines()) if line.strip()]}


@pytest.fixture(scope="module")
def blender(tmp_path_factory):
    return Blender(tmp_path_factory.mktemp("blender"))


@pytest.fixture(scope="module")
def installation(blender, archive):
    """The facts of the installation."""
    return blender.do("install", archive=str(archive))


@pytest.fixture
def extension(blender, installation):
    """What the zip became in a user folder, ready to be used."""
    assert installation["enabled"]
    return blender


def unexpected(said):
    return [line for line in said if not any(re.fullmatch(harmless, line) for harmless in HARMLESS)]


def assert_done_by_what_is_installed(facts, blender):
    """The worker, too, was the installed one, with the library that came in the zip; and nothing is left of it."""
    assert len(facts["workers"]) > 0
    extensions = (blender.user / "extensions").resolve()
    for worker in facts["workers"]:
        package, library = (Path(worker[name]).resolve() for name in ("stereo_reproject.programs.worker", "OpenEXR"))
        assert package.is_relative_to(extensions / "user_default" / "stereo_reproject")
        assert library.is_relative_to(extensions / ".local")
    assert facts["temporary files"] == []


def views_in(folder):
    """Each view's picture, by what its file's name ends with."""
    found = {}
    for path in sorted(folder.glob("result*.exr")):
        with OpenEXR.File(str(path)) as file:
            found[path.stem.removeprefix("result")] = next(iter(file.channels().values())).pixels
    return found


def size_of_png(path):
    """(width, height), from the header."""
    header = path.read_bytes()[:24]
    assert header.startswith(b"\x89PNG")
    return int.from_bytes(header[16:20], "big"), int.from_bytes(header[20:24], "big")


def test_it_holds_what_ships_and_nothing_else(archive):
    with zipfile.ZipFile(archive) as content:
        names = {name for name in content.namelist() if not name.endswith("/")}
    wheels = {name for name in names if name.startswith("wheels/")}
    sources = (
        path for folder in SHIPPED_FOLDERS for path in (ROOT / folder).rglob("*") if path.suffix in SHIPPED_KINDS
    )
    # Which of them there are, tests/house/test_extension.py says.
    pages = {name for name in names if re.fullmatch(r"docs/([^/]+\.md|images/[^/]+\.png)", name)}
    assert names - wheels - pages == SHIPPED_FILES | {path.relative_to(ROOT).as_posix() for path in sources}
    with zipfile.ZipFile(archive) as content:
        assert sum(content.getinfo(name).compress_size for name in pages) < MAX_PAGES_BYTES
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    assert len(wheels) == len(manifest["wheels"]) / len(manifest["platforms"])


def imported(node):
    """The top-level modules that a statement imports."""
    match node:
        case ast.Import():
            return {alias.name.partition(".")[0] for alias in node.names}
        case ast.ImportFrom(level=0):
            return {(node.module or "").partition(".")[0]}
    return set()


def reaches_out(source):
    """Ways to the network, and to code that was not installed, that a module uses.

    Going through the entries of sys.path changes nothing; whatever else is done with it may.
    """
    found = set()
    nodes = list(ast.walk(ast.parse(source)))
    gone_through = [node.iter for node in nodes if isinstance(node, ast.comprehension | ast.For)]
    for node in nodes:
        found |= imported(node) & NEVER_IMPORTED
        match node:
            case ast.Attribute(value=ast.Name(id="sys"), attr="path") if node not in gone_through:
                found.add("sys.path")
            case ast.ImportFrom(module="sys", names=names) if any(alias.name == "path" for alias in names):
                found.add("sys.path")
            case ast.Constant(value="ensurepip" | "pip" as installer):
                found.add(installer)  # python -m pip
    return found


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("import sys\nsys.path.append('x')", {"sys.path"}),
        ("import sys\npath = sys.path", {"sys.path"}),
        ("import sys\nfor entry in sys.path:\n    sys.path.remove(entry)", {"sys.path"}),
        ("import sys\nfound = [entry for entry in sys.path if entry]", set()),
        ("from sys import path", {"sys.path"}),
        ("def f():\n    from urllib.request import urlopen", {"urllib"}),
        ("import http.client, socket as s", {"http", "socket"}),
        ("run([executable, '-m', 'pip', 'install'])", {"pip"}),
        ("from .socket import x\nsocket = node.inputs[0].path", set()),
    ],
)
def test_what_reaches_out_is_noticed(source, found):
    assert reaches_out(source) == found


def test_it_neither_reaches_into_the_network_nor_changes_the_import_path(archive):
    with zipfile.ZipFile(archive) as content:
        code = [name for name in content.namelist() if name.endswith(".py")]
        found = {name: reaches_out(content.read(name)) for name in code}
    assert len(found) > len(SHIPPED_FOLDERS)
    assert {name: what for name, what in found.items() if what} == {}


def test_its_manifest_says_what_it_is_permitted(archive):
    with zipfile.ZipFile(archive) as content:
        manifest = tomllib.loads(content.read("blender_manifest.toml").decode("utf-8"))
    assert manifest["permissions"]["files"]


def test_it_is_installed_and_enabled_without_a_warning(blender, installation):
    assert installation["result"] == ["FINISHED"]
    assert installation["registered"]
    assert Path(installation["extensions"]).is_relative_to(blender.user)
    package = Path(installation["extensions"], "user_default", "stereo_reproject")
    assert Path(installation["module"]).resolve() == (package / "__init__.py").resolve()
    assert unexpected(installation["said"]) == []


def test_the_wheel_of_this_python_is_installed_with_it(extension):
    libraries = [path for path in (extension.user / "extensions" / ".local").rglob("OpenEXR*") if path.is_file()]
    assert [path.name for path in libraries] == ["OpenEXR" + sysconfig.get_config_var("EXT_SUFFIX")]
    assert libraries[0].stat().st_size > 0


def test_it_goes_without_a_trace_and_comes_back(extension):
    facts = extension.do("cycle")
    before, there, gone, back, gone_again = facts["traces"]
    assert "RENDER_PT_stereo_reproject" in there["types"]
    assert "render.stereo_reproject_image" in there["operators"]
    assert "Scene.stereo_reproject" in there["properties"]
    assert there["render menu"] == before["render menu"] + 1
    assert gone == before
    assert back == there
    assert gone_again == before
    assert unexpected(facts["said"]) == []


@pytest.mark.parametrize(("preview", "size"), [(False, SIZE), (True, SIZE_OF_PREVIEW)], ids=["whole", "preview"])
def test_an_image_is_rendered(extension, tmp_path, preview, size):
    facts = extension.do("image", blend=str(DEMO), output=str(tmp_path), preview=preview)
    assert facts["result"] == ["FINISHED"]
    views = views_in(tmp_path)
    assert {name: eye.shape[1::-1] for name, eye in views.items()} == {"_L": size, "_R": size}
    assert (views["_L"] != views["_R"]).any()
    words = (
        r"of this preview\. A full render .*"
        if preview
        else r"(: all of it was rendered)?\. (.* saved|No time saved.*)"
    )
    assert any(re.fullmatch(rf"Info: .* rendering both eyes ?{words}", line) for line in facts["said"]), facts["said"]
    assert unexpected(facts["said"]) == []
    assert_done_by_what_is_installed(facts, extension)


@pytest.mark.parametrize(
    ("views_format", "files"),
    [
        ("INDIVIDUAL", ["name0001_L.png", "name0001_R.png", "name0002_L.png", "name0002_R.png"]),
        ("STEREO_3D", ["name0001.png", "name0002.png"]),
    ],
)
def test_an_animation_is_written_as_blender_names_it(extension, tmp_path, views_format, files):
    facts = extension.do("animation", blend=str(DEMO), output=str(tmp_path), views_format=views_format)
    assert facts["result"] == ["FINISHED"]
    # Beside them, what tells of them.
    names = {path.name for path in tmp_path.iterdir()}
    assert sorted(name for name in names if not name.startswith((JOURNAL, "name_animation."))) == files
    assert "name_animation.json" in names
    # Blender's default for both views in one picture is an anaglyph, as large as either.
    assert {size_of_png(tmp_path / name) for name in files} == {SIZE}
    assert any(line.startswith("Info: 2 stereo frames rendered") for line in facts["said"])
    assert unexpected(facts["said"]) == []
    assert_done_by_what_is_installed(facts, extension)


def test_a_scene_is_checked(extension):
    facts = extension.do("check", blend=str(DEMO))
    assert facts["result"] == ["FINISHED"]
    assert facts["size"] == list(SIZE)
    assert facts["effects"] > 0
    assert any(re.match("Info: (Predicted|Reprojection will not pay): ", line) for line in facts["said"])
    assert unexpected(facts["said"]) == []
    assert_done_by_what_is_installed(facts, extension)


def test_the_convergence_is_set_to_an_object_and_to_the_focus(extension):
    facts = extension.do("convergence", blend=str(DEMO))
    assert facts["found"] == pytest.approx(facts["expected"], rel=1e-5), "single precision, and a matrix inverted"
    assert unexpected(facts["said"]) == []


def test_pictures_that_explain_a_pair_are_shown_in_an_image_editor_alone(extension):
    facts = extension.do("pictures", blend=str(DEMO))
    assert not facts["elsewhere"]
    assert facts["there"]
    assert "There is no such picture" in facts["refusal"]
    shown = {
        "HOLES": "Stereo Rendered Again",
        "GRID": "Stereo Grid",
        "ERRORS": "Stereo Uncertain Areas",
        "PAIR": "Render Result",
    }
    assert facts["shown"] == shown
    assert [line for line in unexpected(facts["said"]) if line not in facts["refusal"]] == []
    assert_done_by_what_is_installed(facts, extension)


def test_there_is_nothing_to_cancel_when_nothing_runs(extension):
    facts = extension.do("cancel")
    assert facts["poll"] is False
    assert unexpected(facts["said"]) == []


def test_the_command_line_within_blender_inspects_a_scene(extension):
    facts = extension.do("command", arguments=["inspect", str(DEMO), "--no-sketch", "--json"])
    assert facts["status"] == 0
    assert json.loads(facts["out"])["scene"] == DEMO.stem
    assert unexpected(facts["said"]) == []
    assert_done_by_what_is_installed(facts, extension)

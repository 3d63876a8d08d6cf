"""Installs the add-on in Blender, makes scenes to render with it, and reads the files that Blender writes. Needs bpy.

The zip is installed as by a user, into a temporary repository of extensions.
"""

import atexit
import functools
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from unittest import mock

import bmesh
import bpy
import numpy

import support

import package

_REPOSITORY = "caustique_test"
ADDON = f"bl_ext.{_REPOSITORY}.caustique"
#: A script that reads EXRs with OpenEXR's library, which Blender's Python lacks: lines of pairs of paths.
_READER = """
import sys, numpy, OpenEXR
for line in iter(sys.stdin.readline, ""):
    source, target = line.rstrip("\\n").split("\\t")
    found = {}
    for part in OpenEXR.File(source, separate_channels=True).parts:
        found.update((name, channel.pixels) for name, channel in part.channels.items())
    numpy.savez(target, **found)
    print("read", flush=True)
"""


@functools.cache
def _reader():
    """The process that reads EXRs: one for all tests. It ends with its input."""
    python = support.ROOT / ".venv" / "bin" / "python"
    return subprocess.Popen([python, "-c", _READER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def channels(path):
    """The channels of all parts of an EXR file, {name: pixels}."""
    with tempfile.NamedTemporaryFile(suffix=".npz") as file:
        print(path, file.name, sep="\t", file=_reader().stdin, flush=True)
        if _reader().stdout.readline() != "read\n":
            _reader.cache_clear()
            raise OSError(f"{path} cannot be read")
        with numpy.load(file.name) as found:
            return dict(found)


def part_of_addon(name):
    """A module of the installed add-on."""
    return sys.modules[f"{ADDON}.{name}"]


class Installed(support.Scratch):
    """Installs the add-on and makes it the engine of a scene. `stage` adds a lit plane and a glass ball, seen from
    above. Tests share one installation and enable it anew, unless their class sets `installs`."""

    installs = False
    _shared = None

    def setUp(self):
        super().setUp()
        bpy.ops.wm.read_factory_settings(use_empty=True)
        if self.installs or Installed._shared is None:
            self.install()
        else:
            self.place = self.add_repository(Installed._shared)
            bpy.ops.preferences.addon_enable(module=ADDON)
            self.addCleanup(self.disable)
        self.preferences = bpy.context.preferences.addons[ADDON].preferences
        self.preferences.program = str(support.binary())
        self.scene = bpy.context.scene
        self.scene.render.engine = "CAUSTIQUE"
        self.scene.render.resolution_x, self.scene.render.resolution_y = 32, 24
        self.settings = self.scene.caustique_render
        self.settings.iterations, self.settings.method = 2, "vcm"
        self.layer = self.scene.view_layers[0]

    def add_repository(self, folder):
        """Add a repository of extensions in a folder to Blender's preferences. Returns it."""
        self.repository = folder
        repositories = bpy.context.preferences.extensions.repos
        place = repositories.new(name=_REPOSITORY, module=_REPOSITORY, custom_directory=str(folder))
        self.addCleanup(repositories.remove, place)
        return place

    def install(self):
        """Install the package as a user does: for this test, or for this and later ones."""
        folder = self.dir
        if not self.installs:
            folder = Path(tempfile.mkdtemp(prefix="caustique-"))
            atexit.register(shutil.rmtree, folder, ignore_errors=True)
            Installed._shared = folder / "extensions"
        self.zip = folder / "caustique.zip"
        package.build(str(self.zip), self.wheel())
        self.place = self.add_repository(folder / "extensions")
        self.before = self.registered()
        bpy.ops.extensions.package_install_files(filepath=str(self.zip), repo=_REPOSITORY, enable_on_install=True)
        self.addCleanup(self.uninstall if self.installs else self.disable)

    def disable(self):
        """Disable the add-on, and forget its modules."""
        if ADDON in bpy.context.preferences.addons:
            bpy.ops.preferences.addon_disable(module=ADDON)
        for name in [name for name in sys.modules if name == ADDON or name.startswith(ADDON + ".")]:
            del sys.modules[name]

    def wheel(self):
        """The wheel that the extension contains; None for none."""
        return None

    def uninstall(self):
        if ADDON in bpy.context.preferences.addons:
            index = list(bpy.context.preferences.extensions.repos).index(self.place)
            bpy.ops.extensions.package_uninstall(repo_index=index, pkg_id="caustique")

    def registered(self):
        """All classes, properties and handlers that an add-on may leave in Blender."""
        kinds = {name for name in dir(bpy.types)}
        of_data = {kind: set(dir(getattr(bpy.types, kind))) for kind in ("Scene", "ViewLayer", "WindowManager")}
        handlers = {name: list(getattr(bpy.app.handlers, name)) for name in dir(bpy.app.handlers)
                    if isinstance(getattr(bpy.app.handlers, name), list)}
        operators = set(dir(bpy.ops.caustique))
        engines = {panel.__name__: frozenset(panel.COMPAT_ENGINES) for panel in bpy.types.Panel.__subclasses__()
                   if hasattr(panel, "COMPAT_ENGINES")}
        files = sorted(path.name for path in self.repository.rglob("*") if path.is_file())
        return kinds, of_data, handlers, operators, engines, files

    def material(self, name, **inputs):
        material = bpy.data.materials.new(name)
        if bpy.app.version < (5, 0, 0):
            material.use_nodes = True
        shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
        for socket, value in inputs.items():
            shader.inputs[socket.replace("_", " ")].default_value = value
        return material

    def put(self, name, data, at=(0, 0, 0), turn=(0, 0, 0)):
        body = bpy.data.objects.new(name, data)
        self.scene.collection.objects.link(body)
        body.location, body.rotation_euler = at, turn
        return body

    def eye(self, height=10, width=4):
        """Add an orthographic camera that looks down from `height` (m) and shows `width` (m)."""
        data = bpy.data.cameras.new("eye")
        data.type, data.ortho_scale = "ORTHO", width
        self.scene.camera = self.put("eye", data, (0, 0, height))

    def sun(self, irradiance, turn=(0, 0, 0)):
        data = bpy.data.lights.new("sun", "SUN")
        data.energy, data.angle = irradiance, 0
        return self.put("sun", data, turn=turn)

    def plane(self, size=20, reflectance=0.5, **placed):
        mesh = bpy.data.meshes.new("plane")
        half = size / 2
        mesh.from_pydata([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], [], [(0, 1, 2, 3)])
        mesh.materials.append(self.material("white", Base_Color=(*[reflectance] * 3, 1), Roughness=1.0,
                                            Specular_IOR_Level=0.0))
        return self.put("plane", mesh, **placed)

    def ball(self, name="ball", at=(0, 0, 1), closed=True, radius=0.7):
        shape = bmesh.new()
        bmesh.ops.create_icosphere(shape, subdivisions=3, radius=radius)
        if not closed:
            bmesh.ops.delete(shape, geom=[v for v in shape.verts if v.co.z > 0.5 * radius], context="VERTS")
        mesh = bpy.data.meshes.new(name)
        shape.to_mesh(mesh)
        shape.free()
        mesh.materials.append(self.material(f"{name} glass", Transmission_Weight=1.0, Roughness=0.0))
        return self.put(name, mesh, at)

    def stage(self):
        self.plane()
        self.ball()
        self.sun(3, (0.4, 0.2, 0))
        self.eye()

    def passes(self, *names):
        """Enable passes of Blender and of the add-on."""
        for name in names:
            setattr(self.layer if name.startswith("use_pass") else self.layer.caustique, name, True)

    def render(self, name="render", animation=False):
        """Render with the engine. Returns the channels of the file that Blender writes, without the view layer's
        name."""
        settings = self.scene.render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = "MULTI_LAYER_IMAGE"
        settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR_MULTILAYER", "32", "ZIP"
        self.scene.render.filepath = str(self.dir / (name + ("-####" if animation else "") + ".exr"))
        if animation:
            bpy.ops.render.render(animation=True)
            frames = range(self.scene.frame_start, self.scene.frame_end + 1)
            return [self.read(self.dir / f"{name}-{frame:04}.exr") for frame in frames]
        bpy.ops.render.render(write_still=True)
        return self.read(self.dir / f"{name}.exr")

    def read(self, path):
        return {name.split(".", 1)[1]: pixels for name, pixels in channels(path).items()}

    def render_and_keep(self):
        """Render and keep the exported file for `by_hand`."""
        run = part_of_addon("run")

        def kept(process, command, folder):
            shutil.copytree(folder, self.dir / "export", dirs_exist_ok=True)
            begin(process, command, folder)

        begin = run.Run.__init__
        with mock.patch.object(run.Run, "__init__", kept):
            return self.render()

    def by_hand(self, *arguments):
        """Render the exported file with the command line. Returns its channels, in the program's axes."""
        glb, picture = self.dir / "export" / "scene.glb", self.dir / "by-hand.exr"
        support.run(["render", glb, "-o", picture, "--width", self.scene.render.resolution_x, "--height",
                     self.scene.render.resolution_y, "--exr-naming", "blender", "--progress", "none", "--iterations",
                     self.settings.iterations, "--method", self.settings.method, *arguments], check=0)
        return self.read(picture)

    @staticmethod
    def temporary():
        """The files that renders left in Blender's temporary folder."""
        return [name for name in os.listdir(bpy.app.tempdir) if name.startswith("caustique-")]

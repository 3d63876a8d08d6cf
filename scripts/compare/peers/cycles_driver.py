"""Renders with Blender's Cycles on the CPU (see driver.py). Modes: `path`, `path_guiding` (Open PGL), and `path_caustics`
(shadow caustics, which is manifold next event estimation: all glass casts caustics, all other surfaces receive them).

Lamps and suns with a size are Blender's own. With shadow caustics, which need such lamps, luminous rectangles are area
lights. Runs in .venv-bpy, which has Blender as a Python module, with OpenEXR from .venv-peers/bpy.
"""

import os
import re
import sys
import tempfile

import bpy
import numpy as np
from mathutils import Matrix

import driver
import pictures
import plain_scene

MODES = ["path", "path_guiding", "path_caustics"]
#: Rotation from +Y up to +Z up.
TURN = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
#: Limit of environment texels, because Cycles stores images in half precision.
MAX_TEXEL = 30000.0
#: Width of the importance map of the environment in pixels.
IMPORTANCE_WIDTH = 2048
#: Sample limit of a render that stops by time.
MAX_SAMPLES = 1 << 20


class Nodes:
    """A node tree under construction."""

    def __init__(self, tree):
        self.tree = tree
        tree.nodes.clear()

    def add(self, kind, **inputs):
        """Add a node. `inputs`: values or sockets by name, with _ for spaces."""
        node = self.tree.nodes.new(f"ShaderNode{kind}")
        for name, value in inputs.items():
            node.inputs[name.replace("_", " ")].default_value = value
        return node

    def link(self, source, target):
        self.tree.links.new(source, target)


def material(of, folder):
    """Make a Blender material."""
    made = bpy.data.materials.new(of.name)
    made.use_nodes = True
    nodes = Nodes(made.node_tree)
    output = nodes.add("OutputMaterial")
    colour = (*of.base, 1.0)
    if of.kind == "matte" and not of.coat:
        shader = nodes.add("BsdfDiffuse", Color=colour, Roughness=0.0)
    elif of.kind == "glass":
        shader = nodes.add("BsdfGlass", Color=colour, Roughness=of.roughness, IOR=of.ior)
        shader.distribution = "MULTI_GGX"
        if of.absorption.any():
            most = of.absorption.max()
            volume = nodes.add("VolumeAbsorption", Color=(*(1 - of.absorption / most), 1.0), Density=most)
            nodes.link(volume.outputs[0], output.inputs["Volume"])
    else:
        shader = nodes.add(
            "BsdfPrincipled",
            Base_Color=colour,
            Roughness=of.roughness,
            IOR=of.ior,
            Metallic=float(of.kind == "metal"),
            Specular_IOR_Level=0.0 if of.kind == "matte" else of.specular / 2,
            Coat_Weight=of.coat,
            Coat_Roughness=of.coat_roughness,
            Coat_IOR=1.5,
        )
        shader.distribution = "MULTI_GGX"
    if of.texture:
        file = os.path.join(folder, f"{made.name}.image")
        with open(file, "wb") as sink:
            sink.write(of.texture)
        image = nodes.add("TexImage")
        image.image = bpy.data.images.load(file)
        nodes.link(image.outputs["Color"], shader.inputs[0])
    surface = shader.outputs[0]
    if of.emission.any():
        surface = with_emission(nodes, surface, of.emission)
    nodes.link(surface, output.inputs["Surface"])
    return made


def with_emission(nodes, surface, radiance):
    """A surface shader plus emission from its front."""
    most = float(radiance.max())
    shine = nodes.add("Emission", Color=(*(radiance / most), 1.0), Strength=most)
    side, total = nodes.add("MixShader"), nodes.add("AddShader")
    nodes.link(nodes.add("NewGeometry").outputs["Backfacing"], side.inputs[0])
    nodes.link(shine.outputs[0], side.inputs[1])
    nodes.link(nodes.add("Emission", Strength=0.0).outputs[0], side.inputs[2])
    nodes.link(surface, total.inputs[0])
    nodes.link(side.outputs[0], total.inputs[1])
    return total.outputs[0]


def add(scene, data, to_world, name):
    """Add an object to the scene."""
    made = bpy.data.objects.new(name, data)
    made.matrix_world = Matrix((TURN @ to_world).tolist())
    scene.collection.objects.link(made)
    return made


def mesh(of):
    """Make a Blender mesh, in Blender's axes."""
    made = bpy.data.meshes.new(of.name)
    made.from_pydata((of.positions @ TURN[:3, :3].T).tolist(), [], of.triangles.tolist())
    if of.uvs is not None:
        uvs = np.stack([of.uvs[:, 0], 1 - of.uvs[:, 1]], 1)[of.triangles.reshape(-1)]
        made.uv_layers.new()
        made.uv_layers[0].data.foreach_set("uv", uvs.astype("f4").ravel())
    if of.normals is not None:
        made.polygons.foreach_set("use_smooth", np.ones(len(made.polygons), bool))
        made.normals_split_custom_set_from_vertices((of.normals @ TURN[:3, :3].T).tolist())
    return made


def camera(scene, of):
    """Set the scene's camera."""
    data = bpy.data.cameras.new("camera")
    data.sensor_fit, data.angle_y, data.clip_start, data.clip_end = "VERTICAL", of.yfov, 1e-3, 1e6
    if of.aperture_radius:
        data.dof.use_dof, data.dof.focus_distance = True, of.focus_distance
        # Blender's focal length is in mm.
        data.dof.aperture_fstop = 1e-3 * data.lens / (2 * of.aperture_radius)
    scene.camera = add(scene, data, of.to_world, "camera")


def world(scene, image, folder):
    """Set the environment; None is black."""
    made = scene.world = bpy.data.worlds.new("world")
    made.use_nodes = True
    nodes = Nodes(made.node_tree)
    background = nodes.add("Background", Color=(0, 0, 0, 1))
    nodes.link(background.outputs[0], nodes.add("OutputWorld").inputs["Surface"])
    if image is None:
        return
    scale = max(float(image.max()) / MAX_TEXEL, 1.0)
    file = os.path.join(folder, "environment.exr")
    pictures.write(file, image / scale)
    background.inputs["Strength"].default_value = scale
    texture = nodes.add("TexEnvironment")
    texture.image = bpy.data.images.load(file)
    texture.image.colorspace_settings.name = "Non-Color"
    # Blender: u = 1/2 - atan2(y, x) / 2 pi. The scene: u = atan2(x, -z) / 2 pi. They differ by a quarter turn.
    turn = nodes.add("Mapping", Rotation=(0, 0, np.pi / 2))
    turn.vector_type = "POINT"
    nodes.link(nodes.add("TexCoord").outputs["Generated"], turn.inputs["Vector"])
    nodes.link(turn.outputs[0], texture.inputs["Vector"])
    nodes.link(texture.outputs[0], background.inputs["Color"])
    made.cycles.sampling_method, made.cycles.sample_map_resolution = "MANUAL", IMPORTANCE_WIDTH


def lamp(scene, light):
    """Add a point lamp or a sun."""
    most = float(light.intensity.max())
    if most == 0:
        return
    if light.kind == "point":
        data = bpy.data.lights.new("point", "POINT")
        # Watts from intensity.
        data.energy, data.shadow_soft_size, data.use_soft_falloff = 4 * np.pi * most, light.radius, False
    else:
        data = bpy.data.lights.new("sun", "SUN")
        data.energy, data.angle = most, light.angle
    data.color = light.intensity / most
    add(scene, data, light.to_world, "lamp")


def rectangle(part):
    """The matrix of a unit square (x and y from -1/2 to 1/2) that lies on a mesh, with its front at +z; None if the mesh is
    no rectangle."""
    points = np.unique(part.positions.round(9), axis=0)
    if len(points) != 4 or len(part.triangles) != 2:
        return None
    a, b, c = part.positions[part.triangles[0]]
    front = np.cross(b - a, c - a)
    other = np.cross(*(part.positions[part.triangles[1]][1:] - part.positions[part.triangles[1]][0]))
    centre, (u, v) = points.mean(0), sorted((points[1:] - points[0]), key=np.linalg.norm)[:2]
    size = np.linalg.norm(u) * np.linalg.norm(v)
    flat = front @ other > 0.9999 * np.linalg.norm(front) * np.linalg.norm(other)
    if not flat or abs(u @ v) > 1e-4 * size or abs(np.linalg.norm(front) - size) > 1e-4 * size:
        return None
    if np.cross(u, v) @ front < 0:
        u, v = v, u
    matrix = np.eye(4)
    matrix[:3] = np.stack([u, v, front / np.linalg.norm(front), centre], axis=1)
    return matrix


def area_light(scene, matrix, radiance):
    """Add a rectangular light that shines along +z of `matrix`."""
    data, most = bpy.data.lights.new("area", "AREA"), float(radiance.max())
    width, height = np.linalg.norm(matrix[:3, 0]), np.linalg.norm(matrix[:3, 1])
    data.shape, data.size, data.size_y = "RECTANGLE", width, height
    data.energy, data.color = np.pi * width * height * most, radiance / most
    # Blender's lights shine along -z.
    turned = matrix.copy()
    turned[:3, 0], turned[:3, 1], turned[:3, 2] = matrix[:3, 0] / width, -matrix[:3, 1] / height, -matrix[:3, 2]
    # Blender's new lights are invisible to the camera.
    add(scene, data, turned, "lamp").visible_camera = True


def cast_caustics(scene, casters):
    """Let objects cast caustics, all others receive them, and all lights make them."""
    for made in scene.objects:
        if made.type == "MESH":
            made.cycles.is_caustics_caster = made in casters
            made.cycles.is_caustics_receiver = made not in casters
        elif made.type == "LIGHT":
            made.data.cycles.is_caustics_light = True
    scene.world.cycles.is_caustics_light = True


def build(of, folder, caustics=False):
    """Build the Blender scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene, known, casters = bpy.context.scene, {}, []
    for part, surface in of.meshes:
        square = rectangle(part) if caustics and surface.emission.any() and not surface.base.any() else None
        if square is not None:
            area_light(scene, square, surface.emission)
            continue
        if id(surface) not in known:
            known[id(surface)] = material(surface, folder)
        made = mesh(part)
        made.materials.append(known[id(surface)])
        made.update()
        placed = bpy.data.objects.new(part.name, made)
        scene.collection.objects.link(placed)
        if surface.kind == "glass":
            casters.append(placed)
    camera(scene, of.camera)
    world(scene, of.environment, folder)
    for light in of.lights:
        lamp(scene, light)
    if caustics:
        cast_caustics(scene, casters)
    return scene


def approximations(scene):
    """Texts about features that Cycles approximates."""
    found = list(scene.approximations)
    if any(of.kind == "glass" and of.base.min() < 1 for _, of in scene.meshes):
        found.append("glass also tints what it reflects")
    return found


def set_render_settings(scene, options):
    """Set the render settings."""
    render, cycles = scene.render, scene.cycles
    render.engine, cycles.device, render.threads_mode, render.threads = "CYCLES", "CPU", "FIXED", options.threads
    render.resolution_x, render.resolution_y, render.resolution_percentage = options.width, options.height, 100
    for name in ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces", "transparent_max_bounces"):
        setattr(cycles, name, options.depth)
    cycles.caustics_reflective = cycles.caustics_refractive = True
    cycles.use_guiding, cycles.blur_glossy = options.mode == "path_guiding", 0
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.pixel_filter_type, cycles.samples = "BOX", MAX_SAMPLES
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    render.use_persistent_data = render.film_transparent = False


def render(scene, seconds, seed, folder):
    """Render for `seconds`. Returns the picture and its samples per pixel, which Cycles prints only on standard
    output."""
    scene.cycles.time_limit, scene.cycles.seed = max(seconds, 0.05), seed
    scene.render.filepath = os.path.join(folder, "picture.exr")
    with tempfile.TemporaryFile() as log:
        sys.stdout.flush()
        terminal = os.dup(1)
        os.dup2(log.fileno(), 1)
        try:
            bpy.ops.render.render(write_still=True)
        finally:
            sys.stdout.flush()
            os.dup2(terminal, 1)
            os.close(terminal)
        log.seek(0)
        samples = max([int(found) for found in re.findall(rb"Sample (\d+)/", log.read())] or [1])
    return pictures.read(scene.render.filepath).astype(float), samples


def main():
    options = driver.options(MODES)
    of = plain_scene.Scene(options.scene, options.camera, lamps="lamps", suns="lamps")
    if of.blockers:
        driver.print_answer(cannot=of.blockers)
        return
    with tempfile.TemporaryDirectory(prefix="caustique-cycles-") as folder:
        scene = build(of, folder, options.mode == "path_caustics")
        set_render_settings(scene, options)
        watch, total = driver.Stopwatch(options), 0.0

        def one(number):
            nonlocal total
            # Cycles stops by the wall clock: with the CPU clock, repeat with the remaining budget.
            picture, samples = render(scene, watch.left(), options.seed + 7919 * number, folder)
            total = total + samples * picture
            return samples

        samples = one(0) if options.clock == "wall" else driver.run_passes(watch, one)
        driver.report(watch, samples, bpy.app.version_string, approximations(of))
        pictures.write(options.output, total / samples)


main()

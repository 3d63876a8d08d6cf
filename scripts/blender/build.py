"""Helpers for the scripts that make the scenes in `scenes/`: materials, shapes, lights, camera, export.

Lengths are metres, angles degrees, colours scene-linear Rec. 709; Blender's axes: +Z is up, and the front of a scene
faces -Y.

    python3 scenes/NAME.py                              write scenes/NAME.glb
    python3 scenes/NAME.py --preview P.png [SAMPLES]    render it with Cycles instead
"""

import math
import os
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import bpy  # first: it makes the others importable

import bmesh
import numpy
from mathutils import Matrix, Vector

import export


def start(width=1280, height=720):
    """Begin an empty scene with this resolution in pixels."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = width, height


# Materials


def principled(name, color=(0.8, 0.8, 0.8), roughness=0.5, texture=None, normal=None, **inputs):
    """A Principled material. `texture` and `normal` are images; `inputs` are values by socket name, with _ for
    spaces."""
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    tree = material.node_tree
    shader = next(n for n in tree.nodes if n.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = (*color, 1)
    shader.inputs["Roughness"].default_value = roughness
    for socket, value in inputs.items():
        shader.inputs[socket.replace("_", " ")].default_value = value
    if texture is not None:
        tree.links.new(_image_node(tree, texture).outputs["Color"], shader.inputs["Base Color"])
    if normal is not None:
        bend = tree.nodes.new("ShaderNodeNormalMap")
        tree.links.new(_image_node(tree, normal).outputs["Color"], bend.inputs["Color"])
        tree.links.new(bend.outputs["Normal"], shader.inputs["Normal"])
    return material


def _image_node(tree, image):
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    return node


def metal(name, color, roughness=0.0):
    """A conductor: `color` is its reflectance at normal incidence."""
    return principled(name, color, roughness, Metallic=1.0)


def glass(name, ior=1.5, roughness=0.0, absorption=None, abbe=None):
    """A clear dielectric; `absorption` is sigma_a in 1/m per channel, `abbe` the number V_d of its dispersion."""
    material = principled(name, (1, 1, 1), roughness, IOR=ior, Transmission_Weight=1.0)
    if absorption is not None:
        tree, density = material.node_tree, max(absorption)
        volume = tree.nodes.new("ShaderNodeVolumeAbsorption")
        volume.inputs["Color"].default_value = [1 - s / density for s in absorption] + [1]
        volume.inputs["Density"].default_value = density
        tree.links.new(volume.outputs[0], export.shading.output_of(tree).inputs["Volume"])
    if abbe is not None:
        material["abbe"] = float(abbe)
    return material


def emission(name, radiance):
    """A black surface that emits this radiance (W/sr/m2) from the front of its faces."""
    strength = max(radiance)
    material = principled(name, (0, 0, 0), 1.0, Specular_IOR_Level=0.0,
                          Emission_Color=(*(c / strength for c in radiance), 1), Emission_Strength=strength)
    material[export.shading.ONE_SIDED] = True
    return material


def image(name, pixels, data=False, quality=85):
    """Pack an array (height, width, 3) of display values in [0, 1], first row at the bottom, as a JPEG image."""
    height, width, _ = pixels.shape
    whole = numpy.ones((height, width, 4), numpy.float32)
    whole[..., :3] = numpy.clip(pixels, 0, 1)
    raw = bpy.data.images.new(name + " raw", width, height)
    raw.pixels.foreach_set(whole.ravel())
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, name + ".jpg")
        raw.file_format = "JPEG"
        raw.save(filepath=path, quality=quality)
        bpy.data.images.remove(raw)
        packed = bpy.data.images.load(path)
        packed.name = name
        packed.pack()
    if data:
        packed.colorspace_settings.name = "Non-Color"
    return packed


def noise(height, width, cells, octaves=5, seed=0, stretch=(1, 1)):
    """Tileable value noise in [0, 1]: `octaves` layers, the first with `cells` cells times `stretch` (rows,
    columns)."""
    random = numpy.random.default_rng(seed)
    total, weight = numpy.zeros((height, width)), 0.0
    for octave in range(octaves):
        rows, columns = (max(int(cells * s) << octave, 1) for s in stretch)
        lattice = random.random((rows, columns))
        v = numpy.arange(height) / height * rows
        u = numpy.arange(width) / width * columns
        v0, u0 = v.astype(int), u.astype(int)
        fv, fu = v - v0, u - u0
        fv, fu = (fv * fv * (3 - 2 * fv))[:, None], (fu * fu * (3 - 2 * fu))[None, :]
        v1, u1 = (v0 + 1) % rows, (u0 + 1) % columns
        layer = ((lattice[v0][:, u0] * (1 - fu) + lattice[v0][:, u1] * fu) * (1 - fv)
                 + (lattice[v1][:, u0] * (1 - fu) + lattice[v1][:, u1] * fu) * fv)
        total += layer * 0.5 ** octave
        weight += 0.5 ** octave
    return total / weight


def blend(a, b, amount):
    """Mix two colours by an array of amounts into an array of colours."""
    return numpy.asarray(a) * (1 - amount[..., None]) + numpy.asarray(b) * amount[..., None]


# Shapes


def add_object(name, mesh, material, at=(0, 0, 0), turn=(0, 0, 0), scale=(1, 1, 1)):
    """Add an object with this mesh to the scene. Several objects may share a mesh."""
    body = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(body)
    body.location, body.scale = at, scale
    body.rotation_euler = [math.radians(t) for t in turn]
    if material is not None and not mesh.materials:
        mesh.materials.append(material)
    return body


def finish_mesh(name, shape, smooth=True, uv=None):
    """Convert a bmesh to a mesh. `uv`: edge length of a texture, for box-mapped coordinates."""
    bmesh.ops.recalc_face_normals(shape, faces=shape.faces)
    if uv:
        layer = shape.loops.layers.uv.verify()
        for face in shape.faces:
            axis = max(range(3), key=lambda i: abs(face.normal[i]))
            a, b = ((1, 2), (0, 2), (0, 1))[axis]
            for loop in face.loops:
                loop[layer].uv = (loop.vert.co[a] / uv, loop.vert.co[b] / uv)
    mesh = bpy.data.meshes.new(name)
    shape.to_mesh(mesh)
    shape.free()
    if smooth:
        mesh.shade_smooth()
    return mesh


def box(name, size, bevel=0.0, segments=3, uv=None):
    """A box about the origin with rounded edges of radius `bevel`."""
    shape = bmesh.new()
    bmesh.ops.create_cube(shape, size=1.0, matrix=Matrix.Diagonal((*size, 1)))
    if bevel:
        bmesh.ops.bevel(shape, geom=shape.edges[:], offset=bevel, segments=segments, profile=0.5, affect="EDGES",
                        harden_normals=False)
    mesh = finish_mesh(name, shape, smooth=False, uv=uv)
    if bevel:
        _smooth_below(mesh, 40)
    return mesh


def _smooth_below(mesh, degrees):
    """Smooth edges below this angle, with normals weighted by area so that faces beside bevels stay flat."""
    mesh.shade_smooth()
    normals = numpy.zeros((len(mesh.vertices), 3))
    for face in mesh.polygons:
        for vertex in face.vertices:
            normals[vertex] += numpy.asarray(face.normal) * face.area
    limit = math.cos(math.radians(degrees))
    corners = []
    for face in mesh.polygons:
        for vertex in face.vertices:
            mean = Vector(normals[vertex]).normalized()
            corners.append(mean if mean.dot(face.normal) > limit else face.normal)
    mesh.normals_split_custom_set(corners)


def sphere(name, radius, subdivisions=7):
    """A geodesic sphere of 20 * 4^(subdivisions - 1) triangles."""
    shape = bmesh.new()
    bmesh.ops.create_icosphere(shape, subdivisions=subdivisions, radius=radius)
    return finish_mesh(name, shape)


def plane(name, width, depth, uv=None):
    """A rectangle in the XY plane that faces +Z."""
    x, y = width / 2, depth / 2
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)], [], [(0, 1, 2, 3)])
    if uv:
        layer = mesh.uv_layers.new()
        for loop in mesh.loops:
            layer.data[loop.index].uv = [c / uv for c in mesh.vertices[loop.vertex_index].co[:2]]
    return mesh


def lathe(name, profile, sides=96, closed=False, sharp=30, uv=None):
    """A solid of revolution about Z of a profile of (radius, height). Radii of 0 cap the ends; `closed` joins them."""
    shape, rings = bmesh.new(), []
    for radius, height in profile:
        if radius <= 0:
            rings.append([shape.verts.new((0, 0, height))])
        else:
            turns = [2 * math.pi * i / sides for i in range(sides)]
            rings.append([shape.verts.new((radius * math.cos(t), radius * math.sin(t), height)) for t in turns])
    for lower, upper in zip(rings, rings[1:] + rings[:1] if closed else rings[1:]):
        for i in range(sides):
            j = (i + 1) % sides
            corners = [lower[i % len(lower)], lower[j % len(lower)], upper[j % len(upper)], upper[i % len(upper)]]
            corners = list(dict.fromkeys(corners))
            if len(corners) > 2:
                shape.faces.new(corners)
    mesh = finish_mesh(name, shape, uv=uv)
    if sharp:
        mesh.set_sharp_from_angle(angle=math.radians(sharp))
    return mesh


def rounded(points, radius, steps=6):
    """A profile of (radius, height) points with rounded inner corners."""
    result = [points[0]]
    for before, corner, after in zip(points, points[1:], points[2:]):
        a, b, c = (Vector(p) for p in (before, corner, after))
        reach = min(radius, (a - b).length * 0.49, (c - b).length * 0.49)
        start, end = b + (a - b).normalized() * reach, b + (c - b).normalized() * reach
        for i in range(steps + 1):
            t = i / steps
            result.append(tuple(start * (1 - t) ** 2 + b * 2 * t * (1 - t) + end * t ** 2))
    return result + [points[-1]]


def polyhedron(name, planes, reach=4.0):
    """The convex polyhedron of all points x with normal . x <= offset for every (normal, offset)."""
    shape = bmesh.new()
    bmesh.ops.create_cube(shape, size=reach)
    for normal, offset in planes:
        axis = Vector(normal).normalized()
        cut = bmesh.ops.bisect_plane(shape, geom=shape.verts[:] + shape.edges[:] + shape.faces[:], dist=1e-6,
                                     plane_co=axis * (offset / Vector(normal).length), plane_no=axis, clear_outer=True)
        rim = [e for e in cut["geom_cut"] if isinstance(e, bmesh.types.BMEdge) and e.is_valid]
        if rim:
            bmesh.ops.contextual_create(shape, geom=rim)
    return finish_mesh(name, shape, smooth=False)


def torus(name, major, minor, around=192, about=96):
    """A torus about Z: `major` is the radius of the ring, `minor` that of the tube."""
    shape = bmesh.new()
    rings = [[shape.verts.new(((major + minor * math.cos(b)) * math.cos(a), (major + minor * math.cos(b)) * math.sin(a),
                               minor * math.sin(b))) for b in numpy.linspace(0, 2 * math.pi, about, endpoint=False)]
             for a in numpy.linspace(0, 2 * math.pi, around, endpoint=False)]
    for i in range(around):
        for j in range(about):
            k, m = (i + 1) % around, (j + 1) % about
            shape.faces.new((rings[i][j], rings[k][j], rings[k][m], rings[i][m]))
    return finish_mesh(name, shape)


def tube(name, path, radius, sides=24, closed=False):
    """A round tube along a path of points, with capped ends, or a loop if `closed`."""
    points = [Vector(p) for p in path]
    shape, rings, across = bmesh.new(), [], None
    for i, here in enumerate(points):
        before = points[i - 1] if i or closed else here
        after = points[(i + 1) % len(points)] if i + 1 < len(points) or closed else here
        along = (after - before).normalized()
        across = along.orthogonal() if across is None else across - along * across.dot(along)
        across.normalize()
        other = along.cross(across)
        turns = [2 * math.pi * k / sides for k in range(sides)]
        rings.append([shape.verts.new(here + (across * math.cos(t) + other * math.sin(t)) * radius) for t in turns])
    for lower, upper in zip(rings, rings[1:] + (rings[:1] if closed else [])):
        for i in range(sides):
            j = (i + 1) % sides
            shape.faces.new((lower[i], lower[j], upper[j], upper[i]))
    if not closed:
        shape.faces.new(rings[0])
        shape.faces.new(rings[-1])
    mesh = finish_mesh(name, shape)
    mesh.set_sharp_from_angle(angle=math.radians(50))
    return mesh


def arc(points, radius, steps=10):
    """A path of points in space with rounded inner corners."""
    result = [Vector(points[0])]
    for a, b, c in zip(*(map(Vector, points[i:]) for i in range(3))):
        reach = min(radius, (a - b).length * 0.49, (c - b).length * 0.49)
        start, end = b + (a - b).normalized() * reach, b + (c - b).normalized() * reach
        result += [start * (1 - t) ** 2 + b * 2 * t * (1 - t) + end * t ** 2 for t in (k / steps for k in range(steps + 1))]
    return result + [Vector(points[-1])]


def sheet(name, columns, rows, position, bottom=None, uv=False):
    """A smooth grid of `position(u, v)` -> (x, y, z), u and v in [0, 1]. `bottom`: height of a base that closes it."""
    shape = bmesh.new()
    grid = [[shape.verts.new(position(i / columns, j / rows)) for i in range(columns + 1)] for j in range(rows + 1)]
    for j in range(rows):
        for i in range(columns):
            shape.faces.new((grid[j][i], grid[j][i + 1], grid[j + 1][i + 1], grid[j + 1][i]))
    if uv:
        layer, index = shape.loops.layers.uv.verify(), {v: k for k, v in enumerate(v for row in grid for v in row)}
        for face in shape.faces:
            for loop in face.loops:
                k = index[loop.vert]
                loop[layer].uv = (k % (columns + 1) / columns, k // (columns + 1) / rows)
    if bottom is not None:
        rim = (grid[0][:-1] + [row[-1] for row in grid[:-1]] + grid[-1][:0:-1] + [row[0] for row in grid[:0:-1]])
        foot = [shape.verts.new((v.co.x, v.co.y, bottom)) for v in rim]
        for k in range(len(rim)):
            m = (k + 1) % len(rim)
            shape.faces.new((rim[m], rim[k], foot[k], foot[m]))
        shape.faces.new(foot[::-1])
    mesh = finish_mesh(name, shape) if bottom is not None else _raw(name, shape)
    if bottom is not None:
        mesh.set_sharp_from_angle(angle=math.radians(50))
    return mesh


def _raw(name, shape):
    mesh = bpy.data.meshes.new(name)
    shape.to_mesh(mesh)
    shape.free()
    mesh.shade_smooth()
    return mesh


# Lights and camera


def _lamp(name, kind, color, energy):
    light = bpy.data.lights.new(name, kind)
    light.color, light.energy = color, energy
    body = bpy.data.objects.new(name, light)
    bpy.context.scene.collection.objects.link(body)
    return body


def sun(name, toward, irradiance, color=(1, 1, 1), angle=0.53):
    """A sun whose light travels along `toward`: W/m2 on a perpendicular surface, `angle` the diameter of its disc."""
    body = _lamp(name, "SUN", color, irradiance)
    body.rotation_euler = Vector(toward).to_track_quat("-Z", "Y").to_euler()
    body.data.angle = math.radians(angle)
    return body


def point(name, at, watts, color=(1, 1, 1), radius=0.01):
    """A point lamp with a power of `watts`."""
    body = _lamp(name, "POINT", color, watts)
    body.location, body.data.shadow_soft_size = at, radius
    body.data.use_soft_falloff = False  # without it Cycles also renders an emissive sphere
    return body


def spot(name, at, to, watts, angle, color=(1, 1, 1), blend=0.3, radius=0.01):
    """A spotlight. `angle`: full cone. `watts`: power without the cone, as in Blender."""
    body = point(name, at, watts, color, radius)
    body.data.type = "SPOT"
    light = bpy.data.lights[body.data.name]
    light.spot_size, light.spot_blend, light.shadow_soft_size = math.radians(angle), blend, radius
    body.rotation_euler = (Vector(to) - Vector(at)).to_track_quat("-Z", "Y").to_euler()
    return body


def sky(color=None, file=None, strength=1.0):
    """Set the environment: one radiance, or a lat-long image."""
    world = bpy.data.worlds.new("World")
    if bpy.app.version < (5, 0, 0):
        world.use_nodes = True
    bpy.context.scene.world = world
    background = next(n for n in world.node_tree.nodes if n.type == "BACKGROUND")
    background.inputs["Strength"].default_value = strength
    if color is not None:
        background.inputs["Color"].default_value = (*color, 1)
    if file is not None:
        node = world.node_tree.nodes.new("ShaderNodeTexEnvironment")
        node.image = bpy.data.images.load(file)
        world.node_tree.links.new(node.outputs["Color"], background.inputs["Color"])
    return world


def dome(radiance, width=96):
    """Set the environment to an image of `radiance(x, y, z)`: unit vectors (height, width) to colours (height, width,
    3)."""
    v, u = numpy.mgrid[0:width // 2, 0:width] + 0.5
    turn, lift = (0.5 - u / width) * 2 * math.pi, (v / (width // 2) - 0.5) * math.pi
    whole = numpy.ones((width // 2, width, 4), numpy.float32)
    whole[..., :3] = radiance(numpy.cos(lift) * numpy.cos(turn), numpy.cos(lift) * numpy.sin(turn), numpy.sin(lift))
    raw = bpy.data.images.new("dome", width, width // 2, float_buffer=True)
    raw.colorspace_settings.name = "Non-Color"  # no colour conversion
    raw.pixels.foreach_set(whole.ravel())
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "dome.exr")
        raw.file_format = "OPEN_EXR"
        raw.save(filepath=path)
        bpy.data.images.remove(raw)
        world = sky(file=path)
        bpy.data.images["dome.exr"].pack()
    return world


def camera(at, to, lens=35.0, fstop=None, focus=None, name="Camera"):
    """Add a camera at `at` that looks at `to`: `lens` in mm on 36 mm film, `fstop` with focus at the point `focus`.

    The first camera is the scene's.
    """
    eye = bpy.data.cameras.new(name)
    body = bpy.data.objects.new(name, eye)
    bpy.context.scene.collection.objects.link(body)
    bpy.context.scene.camera = bpy.context.scene.camera or body
    eye.lens, eye.clip_start = lens, 0.01
    body.location = at
    body.rotation_euler = (Vector(to) - Vector(at)).to_track_quat("-Z", "Y").to_euler()
    if fstop is not None:
        axis = (Vector(to) - Vector(at)).normalized()
        eye.dof.use_dof, eye.dof.aperture_fstop = True, fstop
        eye.dof.focus_distance = axis.dot(Vector(focus or to) - Vector(at))
    return body


def finish(script):
    """Write the .glb beside the scene's script, or render the preview. Scripts call it last, with __file__."""
    stem = os.path.splitext(os.path.abspath(script))[0]
    if "--preview" in sys.argv:
        rest = sys.argv[sys.argv.index("--preview") + 1:]
        _preview(os.path.abspath(rest[0]), int(rest[1]) if len(rest) > 1 else 64, float(rest[2]) if len(rest) > 2 else 25)
    else:
        warnings = export.write(stem + ".glb")
        megabytes = os.path.getsize(stem + ".glb") / 1e6
        print(f"{os.path.basename(stem)}.glb: {megabytes:.2f} MB, {len(warnings)} warnings")
    sys.stdout.flush()
    os._exit(0)


def _preview(path, samples, percentage):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = samples, False
    scene.cycles.max_bounces = 24
    scene.cycles.transmission_bounces = scene.cycles.glossy_bounces = scene.cycles.diffuse_bounces = 16
    scene.cycles.sample_clamp_indirect = 0
    scene.cycles.blur_glossy = 0
    for body in scene.objects:  # a path tracer finds few caustics: shadow rays pass glass
        if body.type == "MESH" and any(export.may_transmit(m) for m in body.data.materials):
            body.visible_shadow = body.visible_diffuse = False
    scene.render.resolution_percentage = int(percentage)
    scene.view_settings.view_transform = "AgX"
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)

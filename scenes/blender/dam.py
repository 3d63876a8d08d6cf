"""A dam break with foam, which runs against a tumbler: .venv-bpy/bin/python dam.py OUT.blend

Position-based fluids [Macklin and Mueller 2013] move the particles here. Geometry nodes make the water's surface, which
has other faces in each frame and the attribute `velocity`, and instances of foam with the attribute `foam`.
"""

import math

import bpy  # First, because it brings the others.

import numpy
import stage

FRAMES, STEPS, RATE = 20, 4, 24  # frames of the animation, steps of a frame, frames per second
SPACING = 0.05  # of the particles (m)
REACH = 2.2 * SPACING  # of the kernels (m)
TANK = numpy.array([1.6, 0.4, 2.0])
TUMBLER, RADIUS, HEIGHT = numpy.array([1.15, 0.2]), 0.09, 0.3


def kernels(apart):
    """Poly6 and the factor of the gradient of the spiky kernel, without constants, for distances (n, n) in reaches."""
    inside = numpy.clip(1 - apart, 0, None)
    return numpy.clip(1 - apart**2, 0, None) ** 3, -3 * inside**2


def collide(places):
    """Keep particles in the tank and out of the tumbler."""
    numpy.clip(places, 0.5 * SPACING, TANK - 0.5 * SPACING, out=places)
    away = places[:, :2] - TUMBLER
    length = numpy.maximum(numpy.linalg.norm(away, axis=1), 1e-9)
    inside = (length < RADIUS + 0.4 * SPACING) & (places[:, 2] < HEIGHT)
    places[inside, :2] = TUMBLER + (away / length[:, None] * (RADIUS + 0.4 * SPACING))[inside]


def simulate():
    """Positions (m) and velocities (m/s) of the particles in each frame: two arrays (frames, count, 3)."""
    axes = [numpy.arange(0.5 * SPACING, end, SPACING) for end in (0.5, 0.4, 0.6)]
    places = numpy.stack(numpy.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    places += numpy.random.default_rng(1).uniform(-1e-3, 1e-3, places.shape)
    speeds, step, found = numpy.zeros_like(places), 1 / (RATE * STEPS), []
    apart = numpy.linalg.norm(places[:, None] - places[None], axis=-1) / REACH
    rest = numpy.percentile(kernels(apart)[0].sum(1), 90)
    for _ in range(FRAMES):
        found.append((places.copy(), speeds.copy()))
        for _ in range(STEPS):
            moved = places + (speeds + numpy.array([0, 0, -9.81]) * step) * step
            collide(moved)
            for _ in range(4):
                away = moved[:, None] - moved[None]
                apart = numpy.linalg.norm(away, axis=-1) / REACH
                weight, slope = kernels(apart)
                excess = numpy.maximum(weight.sum(1) / rest - 1, 0)
                gradient = away * (slope / (numpy.maximum(apart, 1e-6) * REACH**2 * rest))[..., None]
                own = (gradient.sum(1) ** 2).sum(-1) + (gradient**2).sum((1, 2))
                factor = -excess / (own + 20.0)
                moved += ((factor[:, None] + factor[None])[..., None] * gradient).sum(1)
                collide(moved)
            speeds = (moved - places) / step
            near = kernels(numpy.linalg.norm(moved[:, None] - moved[None], axis=-1) / REACH)[0]
            speeds += 0.05 * (near @ speeds / near.sum(1, keepdims=True) - speeds)  # viscosity
            places = moved
    return (numpy.array(part) for part in zip(*found))


def nodes(points, water, foam):
    """Make the particles of the current frame water and foam by geometry nodes."""
    tree = bpy.data.node_groups.new("fluid", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")

    def node(kind, **inputs):
        made = tree.nodes.new(kind)
        for name, value in inputs.items():
            if name[0].islower():
                setattr(made, name, value)
            elif isinstance(value, bpy.types.NodeSocket):
                tree.links.new(value, made.inputs[name.replace("_", " ")])
            else:
                made.inputs[name.replace("_", " ")].default_value = value
        return made

    def of_frame(letter):
        """The particles' attribute of the current frame, such as place12."""
        join = node("GeometryNodeStringJoin")
        for text in (number.outputs[0], node("FunctionNodeInputString", string=letter).outputs[0]):
            tree.links.new(text, join.inputs["Strings"])  # the last link is the first part
        return node("GeometryNodeInputNamedAttribute", data_type="FLOAT_VECTOR", Name=join.outputs[0]).outputs[0]

    def store(geometry, name, kind, domain, value):
        made = node("GeometryNodeStoreNamedAttribute", data_type=kind, domain=domain, Geometry=geometry, Name=name)
        tree.links.new(value, next(s for s in made.inputs if s.name == "Value" and s.enabled))
        return made.outputs[0]

    floor = node("ShaderNodeMath", operation="FLOOR")
    tree.links.new(node("GeometryNodeInputSceneTime").outputs["Frame"], floor.inputs[0])
    number = node("FunctionNodeValueToString")
    tree.links.new(floor.outputs[0], number.inputs[0])
    given = tree.nodes.new("NodeGroupInput").outputs[0]
    placed = node("GeometryNodeSetPosition", Geometry=given, Position=of_frame("place")).outputs[0]
    speed = of_frame("speed")
    cloud = node("GeometryNodeMeshToPoints", Mesh=placed).outputs[0]
    volume = node("GeometryNodePointsToVolume", Points=cloud, Radius=0.9 * SPACING)
    volume.inputs["Voxel Amount"].default_value = 72.0
    surface = node("GeometryNodeVolumeToMesh", Volume=volume.outputs[0], Threshold=0.2).outputs[0]
    nearest = node("GeometryNodeSampleNearest", domain="POINT", Geometry=placed).outputs[0]
    sampled = node("GeometryNodeSampleIndex", data_type="FLOAT_VECTOR", Geometry=placed, Value=speed, Index=nearest).outputs[0]
    surface = store(surface, "velocity", "FLOAT_VECTOR", "POINT", sampled)
    surface = node("GeometryNodeSetShadeSmooth", Geometry=surface).outputs[0]
    surface = node("GeometryNodeSetMaterial", Geometry=surface, Material=water).outputs[0]
    pace = node("ShaderNodeVectorMath", operation="LENGTH")
    tree.links.new(speed, pace.inputs[0])
    fast = node("FunctionNodeCompare", operation="GREATER_THAN", B=2.0, A=pace.outputs["Value"]).outputs[0]
    ball = node("GeometryNodeMeshIcoSphere", Radius=0.25 * SPACING, Subdivisions=2).outputs["Mesh"]
    worn = node("GeometryNodeSetMaterial", Geometry=ball, Material=foam).outputs[0]
    copies = node("GeometryNodeInstanceOnPoints", Points=cloud, Selection=fast, Instance=worn).outputs[0]
    brightness = node("FunctionNodeRandomValue", data_type="FLOAT")
    copies = store(copies, "foam", "FLOAT", "INSTANCE", next(s for s in brightness.outputs if s.enabled))
    both = node("GeometryNodeJoinGeometry")
    for part in (surface, copies):
        tree.links.new(part, both.inputs[0])
    end = tree.nodes.new("NodeGroupOutput")
    tree.links.new(both.outputs[0], end.inputs[0])
    points.modifiers.new("fluid", "NODES").node_group = tree


scene = stage.empty()
water, clear = stage.glass("water", 1.333), stage.glass("glass", 1.5)
tint = water.node_tree.nodes.new("ShaderNodeVolumeAbsorption")
tint.inputs["Color"].default_value, tint.inputs["Density"].default_value = (0.15, 0.65, 0.80, 1), 5.0
water.node_tree.links.new(tint.outputs[0], next(n for n in water.node_tree.nodes if n.type == "OUTPUT_MATERIAL").inputs["Volume"])
water["priority"], clear["priority"] = 1, 2
foam = stage.principled("foam", Roughness=0.8)
reader = foam.node_tree.nodes.new("ShaderNodeAttribute")
reader.attribute_type, reader.attribute_name = "INSTANCER", "foam"
ramp = foam.node_tree.nodes.new("ShaderNodeValToRGB")
ramp.color_ramp.elements[0].color = (0.55, 0.7, 0.8, 1)
foam.node_tree.links.new(reader.outputs["Fac"], ramp.inputs["Fac"])
foam.node_tree.links.new(ramp.outputs["Color"], next(n for n in foam.node_tree.nodes if n.type == "BSDF_PRINCIPLED").inputs["Base Color"])
places, speeds = simulate()
points = stage.mesh("water", places[0], [], water)
for name, values in (("place", places), ("speed", speeds)):
    for frame, rows in enumerate(values, 1):
        layer = points.data.attributes.new(f"{name}{frame}", "FLOAT_VECTOR", "POINT")
        layer.data.foreach_set("vector", rows.astype(numpy.float32).ravel())
nodes(points, water, foam)
wood = stage.principled("wood", Base_Color=(0.50, 0.42, 0.34), Roughness=0.6)
grey = stage.principled("wall", Base_Color=(0.75, 0.77, 0.80), Roughness=0.8)
stage.box("floor", (-0.6, -1.6, -0.1), (2.2, 1.2, 0), wood)
stage.box("wall", (-0.6, 0.6, 0), (2.2, 0.7, 1.4), grey)
r, h = RADIUS, HEIGHT
tumbler = stage.lathe("tumbler", [(0, 0), (0.9 * r, 0), (r, h), (0.93 * r, h), (0.84 * r, 0.02), (0, 0.02)], clear)
tumbler.location = (*TUMBLER, 1e-4)
tumbler.data.set_sharp_from_angle(angle=math.radians(30))
v, u = numpy.mgrid[:64, :128] / 64
window = (abs(v - 0.7) < 0.1) & (abs(u % 0.5 - 0.25) < 0.1)
stage.environment("sky", numpy.where(window[..., None], (5, 5, 5), (0.30, 0.36, 0.45)))
stage.lamp("sun", "SUN", 3.5, (-1.2, -1.0, 2.4), (0.8, 0.2, 0), angle=math.radians(1))
stage.camera((1.0, -1.75, 0.75), (0.84, 0.15, 0.16), 40)
scene.render.fps, scene.frame_start, scene.frame_end = RATE, 1, FRAMES
scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 0.25
scene.frame_set(12)
stage.save()

"""Converts simple Mitsuba 3 scenes to glTF for caustique.

Supported are meshes and simple shapes; diffuse, plastic, principled, glass and metal; area, point, spot, directional
and constant lights, and environment maps.

Mitsuba itself reads the meshes. The file lists all features that are left out or approximated, and caustique warns of
them.
"""

import importlib
import sys
import types
import xml.etree.ElementTree as ET
from pathlib import Path

import mitsuba as mi
import numpy as np
from gltf import Unsupported

# Import the package's pure Python modules without its native part.
_pure = types.ModuleType("pure")
_pure.__path__ = [str(Path(__file__).resolve().parents[3] / "ffi" / "python" / "caustique")]
sys.modules["pure"] = _pure
glb, meshes = (importlib.import_module(f"pure.{name}") for name in ("glb", "meshes"))

#: Facets along a half circle.
HALF_CIRCLE_FACETS = 64
SHAPES = ("obj", "ply", "cube", "rectangle")
WRAPPERS = ("twosided", "bumpmap", "normalmap", "mask")
#: {Mitsuba's name of a dielectric: index of refraction}
INDICES = {
    "vacuum": 1.0,
    "air": 1.000277,
    "water ice": 1.31,
    "ice": 1.31,
    "water": 1.333,
    "fused quartz": 1.458,
    "pyrex": 1.47,
    "acrylic glass": 1.49,
    "polypropylene": 1.49,
    "bk7": 1.5046,
    "sodium chloride": 1.544,
    "amber": 1.55,
    "pet": 1.575,
    "diamond": 2.419,
}


#: Errors that Mitsuba, numpy and this file raise for elements with invalid values.
FAULTS = (AttributeError, KeyError, OSError, RuntimeError, TypeError, ValueError)


def convert(path, output):
    """Convert the XML at `path` to a .glb, with the environment's image beside it."""
    reader = Reader(path, output)
    reader.read(parse(path))
    data = reader.pack()
    if reader.sky is not None:
        mi.Bitmap(reader.sky).write(str(sky_file(output)))
    output.write_bytes(data)
    for loss in reader.losses:
        print(f"{path}: {loss}", file=sys.stderr)


def parse(path):
    """Parse an XML file. Returns its root."""
    try:
        return ET.parse(path).getroot()
    except (ET.ParseError, UnicodeError, ValueError) as error:
        raise Unsupported(f"{path.name}: it is no XML: {error}") from error


def sky_file(output):
    """Path of the environment's image, beside the .glb."""
    return output.with_suffix(".environment.exr")


class Reader:
    """Reads a Mitsuba scene and collects the parts of the glTF file."""

    def __init__(self, path, output):
        self.folder, self.output = path.parent, output
        self.meshes, self.lights, self.cameras, self.losses = [], [], [], []
        self.named, self.defaults, self.said, self.sky = {}, {}, {}, None

    def lose(self, text):
        """Record a feature that is left out or approximated, once."""
        if text not in self.losses:
            self.losses.append(text)

    def read(self, root):
        """Read all elements of the scene."""
        elements = list(self.included(root, ()))
        for element in elements:
            if element.get("id"):
                self.named[element.get("id")] = element
        readers = {"shape": self.shape, "emitter": self.emitter, "sensor": self.sensor}
        for element in elements:
            if element.tag in readers:
                try:
                    readers[element.tag](element)
                except FAULTS as error:
                    name = f'{element.tag} "{element.get("id") or element.get("name") or element.get("type")}"'
                    raise Unsupported(f"{name} cannot be read: {' '.join(str(error).split())}") from error
            elif element.tag not in ("integrator", "bsdf", "texture"):
                self.lose(f"a {element.tag} ({element.get('type')}) is left out")

    def included(self, root, within):
        """The elements of a file and of its included files, with `default` values substituted."""
        elements = [root] if root.tag != "scene" else [element for element in root if element.tag != "default"]
        for default in root.findall("default"):
            self.defaults.setdefault(default.get("name"), self.filled(default.get("value", "")))
        for element in elements:
            for part in element.iter():
                for key, value in part.attrib.items():
                    part.set(key, self.filled(value))
                if part.tag == "include" and part is not element:
                    raise Unsupported(f"an include within a {element.tag}: only those of whole elements are read")
            if element.tag != "include":
                yield element
                continue
            path = self.folder / element.get("filename", "")
            if path in within:
                raise Unsupported(f'include "{path.name}": the file includes itself')
            if not path.is_file():
                raise Unsupported(f'include "{element.get("filename")}": there is no such file')
            yield from self.included(parse(path), (*within, path))

    def filled(self, value):
        """A value with `default` values substituted."""
        for name in sorted(self.defaults, key=len, reverse=True):
            value = value.replace(f"${name}", self.defaults[name])
        return value

    def pack(self):
        """The bytes of the .glb."""
        lit = self.lights or "environment" in self.said or any(any(mesh.material.emission) for mesh in self.meshes)
        for what, there, kinds in (
            ("light", lit, "area, point, spot, directional, constant and envmap"),
            ("camera", self.cameras, "perspective and thinlens"),
        ):
            if not there:
                lost = f" ({'; '.join(self.losses)})" if self.losses else ""
                raise Unsupported(f"the scene has no {what}: read are {kinds}{lost}")
        extras = {**self.said, "losses": self.losses}
        return glb.pack(self.meshes, lights=self.lights, cameras=self.cameras, extras=extras)

    # --- values -------------------------------------------------------------------------------------------------------

    def child(self, element, *names, tag=None):
        """The child with one of the names, or the first with a tag; references are resolved."""
        for child in element:
            target = self.named.get(child.get("id")) if child.tag == "ref" else child
            if target is None:
                raise Unsupported(f'nothing has the id "{child.get("id")}"')
            if child.get("name") in names or tag and target.tag == tag:
                return target
        return None

    def number(self, element, name, usual):
        """The value of a child as a number, or `usual` if absent."""
        found = self.child(element, name)
        if found is None:
            return usual
        try:
            return float(found.get("value"))
        except (TypeError, ValueError):
            raise Unsupported(f"{element.get('type')}: {name} is no number") from None

    def index(self, element, name, usual):
        """An index of refraction, from a number or a name; `usual` if absent."""
        found = self.child(element, name)
        text = usual if found is None else found.get("value", "")
        try:
            return INDICES[text] if text in INDICES else float(text)
        except ValueError:
            known = ", ".join(INDICES)
            raise Unsupported(f'{element.get("type")}: {name}="{text}" is neither a number nor of {known}') from None

    def colour(self, element, name, usual, place):
        """(colour, texture): the colour is 1 if there is a texture, the texture is None without."""
        found = self.child(element, name)
        if found is None:
            return np.broadcast_to(np.array(usual, float), 3), None
        if found.tag == "texture":
            return np.ones(3), self.texture(found, place)
        text = found.get("value", "").strip()
        if found.tag == "rgb" and text.startswith("#"):
            return np.array(mi.load_dict({"type": "rgb", "value": text}).mean()) * np.ones(3), None
        try:
            values = [float(x) for x in text.replace(",", " ").split()]
            return np.broadcast_to(np.array(values), 3).astype(float), None
        except ValueError:
            raise Unsupported(f"{place}: {name} is a spectrum, which this does not read: {text[:40]}") from None

    def file(self, element):
        """The path of an element's file."""
        found = self.child(element, "filename")
        name = "" if found is None else found.get("value", "")
        if not (self.folder / name).is_file():
            raise Unsupported(f'{element.tag} ({element.get("type")}): filename="{name}": there is no such file')
        return self.folder / name

    def texture(self, element, place):
        """The sRGB bytes (height, width, 3) of the bitmap texture `element`; warnings name `place`."""
        if element.get("type") != "bitmap":
            self.lose(f"{place}: a texture of type {element.get('type')} is taken as its mean, a half")
            return None
        raw = self.child(element, "raw")
        bitmap = mi.Bitmap(str(self.file(element)))
        if raw is not None and raw.get("value") == "true":
            bitmap.set_srgb_gamma(False)
        if self.child(element, "to_uv") is not None:
            matrix = self.transform(element, "to_uv")
            if not np.allclose(matrix, np.eye(4)):
                self.lose(f"{place}: the transform of its texture is left out")
        return np.array(bitmap.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.UInt8, True))

    def transform(self, element, name="to_world"):
        """A transform (4, 4), composed of its steps, the last one outermost."""
        found, matrix = self.child(element, name), np.eye(4)
        for step in found if found is not None else ():
            matrix = self.step(step) @ matrix
        return matrix

    def step(self, step):
        """The matrix of one step of a transform."""
        three = [float(step.get(axis, 1.0 if step.tag == "scale" else 0.0)) for axis in "xyz"]
        numbers = [float(x) for x in step.get("value", "").replace(",", " ").split()]
        if step.tag == "matrix":
            if len(numbers) == 9:
                matrix = np.eye(4)
                matrix[:3, :3] = np.reshape(numbers, (3, 3))
                return matrix
            return np.reshape(numbers, (4, 4))
        transform = mi.ScalarTransform4d()
        if step.tag in ("translate", "scale"):
            three = list(np.broadcast_to(numbers, 3)) if numbers else three
            made = transform.translate(three) if step.tag == "translate" else transform.scale(three)
        elif step.tag == "rotate":
            made = transform.rotate(numbers or three, float(step.get("angle")))
        elif step.tag == "lookat":
            words = {key: step.get(key, "0 1 0").replace(",", " ").split() for key in ("origin", "target", "up")}
            made = transform.look_at(**{key: [float(x) for x in point] for key, point in words.items()})
        else:
            raise Unsupported(f"a transform by {step.tag}")
        return np.array(made.matrix)

    # --- shapes -------------------------------------------------------------------------------------------------------

    def shape(self, element):
        """Add a shape with its material."""
        kind = element.get("type")
        place = f"shape {element.get('id') or element.get('name') or len(self.meshes)} ({kind})"
        matrix = self.transform(element)
        if kind in SHAPES:
            made = self.mesh(element, kind)
        elif kind == "sphere":
            given = self.child(element, "center")
            center = 0.0 if given is None else [float(given.get(axis, 0.0)) for axis in "xyz"]
            made = ball(self.number(element, "radius", 1.0), center)
            self.lose(f"{place}: a ball of {2 * HALF_CIRCLE_FACETS * HALF_CIRCLE_FACETS} facets stands in for the sphere")
        elif kind == "disk":
            made = disk()
        else:
            self.lose(f"{place} is left out: shapes are {', '.join(SHAPES)}, sphere and disk")
            return
        flip = self.child(element, "flip_normals")
        inward = flip is not None and flip.get("value") == "true"
        if np.linalg.det(matrix[:3, :3]) < 0.0:
            # glTF keeps the front of a mirrored mesh, Mitsuba flips it.
            inward = not inward
        if inward:
            made["triangles"] = made["triangles"][:, ::-1]
            made["normals"] = None if made["normals"] is None else -made["normals"]
        bsdf, emitter = self.child(element, "bsdf", tag="bsdf"), self.child(element, "emitter", tag="emitter")
        material = self.material(bsdf, place)
        if self.child(element, "interior", tag="medium") is not None:
            self.lose(f"{place}: the medium inside is left out")
        if emitter is not None:
            radiance, texture = self.colour(emitter, "radiance", 1.0, place)
            material.emission = tuple(radiance)
            # Facets emit from their geometric front.
            made["normals"] = None
            if texture is not None:
                self.lose(f"{place}: the texture of its radiance is left out")
        self.meshes.append(meshes.Mesh(name=place, material=material, transform=matrix, **made))

    def mesh(self, element, kind):
        """A mesh shape, loaded by Mitsuba, in object space."""
        described = {"type": kind}
        if kind in ("obj", "ply"):
            described["filename"] = str(self.file(element))
        flat = self.child(element, "face_normals")
        flat = kind in ("cube", "rectangle") or flat is not None and flat.get("value") == "true"
        shape = mi.load_dict(described)
        normals, uvs = np.array(shape.vertex_normals_buffer()), np.array(shape.vertex_texcoords_buffer())
        return {
            "vertices": np.array(shape.vertex_positions_buffer()).reshape(-1, 3),
            "triangles": np.array(shape.faces_buffer()).reshape(-1, 3).astype(np.int64),
            "normals": None if flat or not normals.size else normals.reshape(-1, 3),
            "uvs": uvs.reshape(-1, 2) if uvs.size else None,
        }

    # --- materials ----------------------------------------------------------------------------------------------------

    def material(self, bsdf, place):
        """A shape's material, or Mitsuba's default if it has none."""
        if bsdf is None:
            return meshes.Material(name=place, base_color=(0.5,) * 3, specular=0.0)
        kind = bsdf.get("type")
        if kind in WRAPPERS:
            if kind != "twosided":
                self.lose(f"{place}: {kind} is left out, what it wraps is kept")
            return self.material(self.child(bsdf, tag="bsdf"), place)
        read = getattr(self, f"_{kind.removeprefix('rough')}", None)
        if read is None:
            self.lose(f"{place}: a bsdf of type {kind} is taken as matte")
            return self.material(None, place)
        material = meshes.Material(name=bsdf.get("id") or place)
        alpha = self.number(bsdf, "alpha", 0.1) if kind.startswith("rough") else 0.0
        material.roughness = float(np.sqrt(alpha))
        distribution = self.child(bsdf, "distribution")
        if alpha and (distribution is None or distribution.get("value") != "ggx"):
            self.lose(f"{place}: facets by Beckmann are taken as GGX")
        read(bsdf, material, place)
        return material

    def base(self, bsdf, name, usual, material, place):
        """Set base colour and its texture."""
        colour, material.base_color_texture = self.colour(bsdf, name, usual, place)
        material.base_color = tuple(float(x) for x in colour)

    def _diffuse(self, bsdf, material, place):
        self.base(bsdf, "reflectance", 0.5, material, place)
        material.specular, material.roughness = 0.0, 1.0

    def _plastic(self, bsdf, material, place):
        self.base(bsdf, "diffuse_reflectance", 0.5, material, place)
        material.ior = self.index(bsdf, "int_ior", "polypropylene") / self.index(bsdf, "ext_ior", "air")

    def _dielectric(self, bsdf, material, place):
        self.base(bsdf, "specular_transmittance", 1.0, material, place)
        material.transmission = 1.0
        material.ior = self.index(bsdf, "int_ior", "bk7") / self.index(bsdf, "ext_ior", "air")

    def _thindielectric(self, bsdf, material, place):
        self._dielectric(bsdf, material, place)
        material.thin = True
        self.lose(f"{place}: what is reflected to and fro inside of a thin pane is left out")

    def _conductor(self, bsdf, material, place):
        preset = self.child(bsdf, "material")
        if preset is not None and preset.get("value") == "none":
            reflectance = np.ones(3)
        else:
            described = {"type": "conductor"}
            if preset is not None:
                described["material"] = preset.get("value")
            for name in ("eta", "k"):
                if self.child(bsdf, name) is not None:
                    described[name] = {"type": "rgb", "value": self.colour(bsdf, name, 0.0, place)[0].tolist()}
            reflectance = at_normal_incidence(described)
            self.lose(f"{place}: a metal's reflectance follows Schlick's formula from that at normal incidence")
        tint, material.base_color_texture = self.colour(bsdf, "specular_reflectance", 1.0, place)
        material.base_color, material.metallic = tuple(float(x) for x in reflectance * tint), 1.0

    def _principled(self, bsdf, material, place):
        self.base(bsdf, "base_color", 0.5, material, place)
        material.roughness = self.number(bsdf, "roughness", 0.5)
        material.metallic = self.number(bsdf, "metallic", 0.0)
        material.transmission = self.number(bsdf, "spec_trans", 0.0)
        specular = self.number(bsdf, "specular", 0.5)
        eta = 2.0 / (1.0 - np.sqrt(0.08 * specular)) - 1.0
        material.ior = self.index(bsdf, "eta", str(eta))
        read = ("base_color", "roughness", "metallic", "spec_trans", "specular", "eta")
        for child in bsdf:
            if child.get("name") not in read and child.get("value") not in ("0", "0.0"):
                self.lose(f"{place}: {child.get('name')} of the principled bsdf is left out")

    # --- lights and cameras -------------------------------------------------------------------------------------------

    def emitter(self, element):
        """Add a light that is not part of a shape."""
        kind, matrix = element.get("type"), self.transform(element)
        name = element.get("id") or element.get("name") or kind
        point = self.child(element, "position")
        position = matrix[:3, 3] if point is None else np.array([float(point.get(a, 0)) for a in "xyz"])
        if kind == "point":
            intensity = self.colour(element, "intensity", 1.0, name)[0]
            self.lights.append(meshes.PointLight(name=name, position=position, intensity=intensity))
        elif kind == "spot":
            outer = self.number(element, "cutoff_angle", 20.0)
            inner = self.number(element, "beam_width", outer * 0.75)
            if inner < outer:
                self.lose(f"{name}: the edge of a spot falls off otherwise")
            self.lights.append(
                meshes.SpotLight(
                    name=name,
                    position=position,
                    target=position + matrix[:3, 2],
                    inner=min(inner, outer - 1e-3),
                    outer=outer,
                    intensity=self.colour(element, "intensity", 1.0, name)[0],
                )
            )
        elif kind == "directional":
            given = self.child(element, "direction")
            direction = matrix[:3, 2] if given is None else np.array([float(given.get(a, 0)) for a in "xyz"])
            irradiance = self.colour(element, "irradiance", 1.0, name)[0]
            self.lights.append(meshes.SunLight(name=name, direction=direction, irradiance=irradiance))
        elif kind == "constant":
            self.said["environment"] = {"color": [float(x) for x in self.colour(element, "radiance", 1.0, name)[0]]}
        elif kind == "envmap":
            self.environment(element, matrix)
        else:
            self.lose(f"{name}: an emitter of type {kind} is left out")

    def environment(self, element, matrix):
        """Resample an environment map to caustique's grid. Mitsuba: u = atan2(x, -z) / 2 pi, first and last row at the
        poles."""
        source = mi.Bitmap(str(self.file(element)))
        texels = np.array(source.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
        height, width = texels.shape[:2]
        u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
        turn, polar = 2.0 * np.pi * (u - 0.5), np.pi * v
        world = np.stack([np.sin(polar) * np.cos(turn), np.cos(polar), np.sin(polar) * np.sin(turn)], -1)
        x, y, z = np.moveaxis(world @ np.linalg.inv(matrix[:3, :3]).T, -1, 0)
        column = np.arctan2(x, -z) / (2.0 * np.pi) * width - 0.5
        row = np.arccos(np.clip(y / np.sqrt(x * x + y * y + z * z), -1.0, 1.0)) / np.pi * (height - 1)
        left, top = np.floor(column).astype(int), np.clip(np.floor(row).astype(int), 0, max(height - 2, 0))
        s, t = (column - left)[..., None], (row - top)[..., None]
        below = np.minimum(top + 1, height - 1)
        at = lambda i, j: texels[i, j % width]
        picture = (at(top, left) * (1 - s) + at(top, left + 1) * s) * (1 - t)
        picture += (at(below, left) * (1 - s) + at(below, left + 1) * s) * t
        self.sky = picture.astype(np.float32)
        self.said["environment"] = {"file": sky_file(self.output).name, "strength": self.number(element, "scale", 1.0)}

    def sensor(self, element):
        """Add a camera, with the size of its film."""
        kind, matrix = element.get("type"), self.transform(element)
        if kind not in ("perspective", "thinlens"):
            self.lose(f"a sensor of type {kind} is left out")
            return
        film = self.child(element, "film", tag="film")
        width, height = (
            int(self.number(film, side, usual)) if film is not None else usual
            for side, usual in (("width", 768), ("height", 576))
        )
        if min(width, height) < 1:
            raise Unsupported(f"film: {width} x {height} pixels")
        self.said["resolution"] = [width, height]
        axis = self.child(element, "fov_axis")
        axis = "x" if axis is None else axis.get("value")
        if axis == "smaller":
            axis = "x" if width < height else "y"
        if axis not in ("x", "y"):
            raise Unsupported(f'a field of view along "{axis}"')
        half = np.tan(np.radians(self.number(element, "fov", 39.3)) / 2.0)
        half = half if axis == "y" else half * height / width
        position, ahead = matrix[:3, 3], matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
        self.cameras.append(
            meshes.Camera(
                position=position,
                target=position + ahead,
                up=matrix[:3, 1],
                fov=float(2.0 * np.degrees(np.arctan(half))),
                aspect=width / height,
                aperture_radius=self.number(element, "aperture_radius", 0.0),
                focus_distance=self.number(element, "focus_distance", 1.0),
            )
        )


def at_normal_incidence(described):
    """RGB reflectance of a Mitsuba conductor at normal incidence."""
    bsdf = mi.load_dict(described)
    surface = mi.SurfaceInteraction3f()
    surface.wi = [0.0, 0.0, 1.0]
    _, weight = bsdf.sample(mi.BSDFContext(), surface, 0.5, [0.5, 0.5])
    return np.array(weight, float).ravel()


def ball(radius, center):
    """A sphere as a mesh."""
    theta = np.linspace(0.0, np.pi, HALF_CIRCLE_FACETS + 1)[1:-1, None]
    phi = np.linspace(0.0, 2.0 * np.pi, 2 * HALF_CIRCLE_FACETS, endpoint=False)[None, :]
    rings = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta) + 0.0 * phi, -np.sin(theta) * np.sin(phi)], -1)
    normals = np.concatenate([[[0.0, 1.0, 0.0]], rings.reshape(-1, 3), [[0.0, -1.0, 0.0]]])
    index = 1 + np.arange(rings.shape[0] * rings.shape[1]).reshape(rings.shape[:2])
    after, last = np.roll(index, -1, axis=1), len(normals) - 1
    a, b, c, d = index[:-1], after[:-1], index[1:], after[1:]
    pole = np.zeros_like(index[0])
    triangles = [
        np.stack(t, -1).reshape(-1, 3)
        for t in ((pole, index[0], after[0]), (a, c, b), (b, c, d), (pole + last, after[-1], index[-1]))
    ]
    vertices = normals * radius + center
    return {"vertices": vertices, "triangles": np.concatenate(triangles), "normals": normals, "uvs": None}


def disk():
    """The unit disk as a mesh that faces +Z."""
    phi = np.linspace(0.0, 2.0 * np.pi, 2 * HALF_CIRCLE_FACETS, endpoint=False)
    rim = np.stack([np.cos(phi), np.sin(phi), 0.0 * phi], -1)
    first = np.arange(1, 2 * HALF_CIRCLE_FACETS + 1)
    triangles = np.stack([0 * first, first, np.roll(first, -1)], -1)
    return {"vertices": np.concatenate([[[0.0, 0.0, 0.0]], rim]), "triangles": triangles, "normals": None, "uvs": None}

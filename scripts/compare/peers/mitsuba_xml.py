"""Reads the XML of Mitsuba 0.4 to 3: included files, parameters, search paths, aliases, references and places."""

import re
import xml.parsers.expat

import numpy as np
from gltf import Unsupported

#: Deepest nesting of included files, and of references within an element.
MAX_DEPTH = 15
#: Largest number of elements in a file, so that XML that multiplies itself ends in an error.
MAX_ELEMENTS = 1 << 20
#: Deepest nesting of elements within each other.
MAX_NESTING = 64
#: {Mitsuba's name of a dielectric: index of refraction}
INDICES = {
    "vacuum": 1.0,
    "helium": 1.000036,
    "hydrogen": 1.000132,
    "air": 1.000277,
    "carbon dioxide": 1.00045,
    "water": 1.333,
    "acetone": 1.36,
    "ethanol": 1.361,
    "carbon tetrachloride": 1.461,
    "glycerol": 1.4729,
    "benzene": 1.501,
    "silicone oil": 1.52045,
    "bromine": 1.661,
    "water ice": 1.31,
    "ice": 1.31,
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


class Node:
    """An element: a plug-in or a value."""

    def __init__(self, tag, attributes, place):
        self.tag, self.attributes, self.place = tag, attributes, place
        self.children, self.document, self.version = [], None, 3
        # Whether something has read the element, and whether a message says that it is left out.
        self.used = self.dropped = False

    @property
    def type(self):
        """Name of the plug-in, in lower case."""
        return self.attributes.get("type", "").lower()

    @property
    def id(self):
        return self.attributes.get("id")

    @property
    def name(self):
        return self.attributes.get("name")

    @property
    def title(self):
        """Place and description of the element for messages."""
        called = self.id or (self.name if self.tag not in ("bsdf", "shape", "emitter", "sensor") else None)
        words = [self.tag, f'"{called}"' if called else "", f"({self.type})" if self.type else ""]
        return f"{self.place}: {' '.join(word for word in words if word)}"

    def fault(self, text):
        """An error at the element."""
        return Unsupported(f"{self.title}: {text}")

    def drop(self, text):
        """Warn that the element is left out or replaced, instead of warning about each of its parameters."""
        self.used = self.dropped = True
        self.document.lose(f"{self.title}: {text}")

    def drop_child(self, name, text="is left out"):
        """Warn that a child is left out, if there is one."""
        found = self.child(name)
        if found is not None:
            found.dropped = True
            self.document.lose(f"{self.title}: its {name} {text}")

    def resolved(self):
        """The element that a reference names; any other element itself."""
        node = self
        for _ in range(MAX_DEPTH):
            if node.tag != "ref":
                return node
            found = self.document.named.get(node.id)
            if found is None:
                raise self.fault(f'nothing has the id "{node.id}"; define it, or remove the reference')
            node = found
        raise self.fault("the reference leads to itself")

    def child(self, *names, tag=None):
        """The child with one of the names, or the first with a tag; references are resolved."""
        for child in self.children:
            target = child.resolved() if child.name in names or tag else child
            if child.name in names or tag and target.tag == tag:
                child.used = target.used = True
                return target
        return None

    def all(self, tag):
        """All children with a tag; references are resolved."""
        found = []
        for child in self.children:
            target = child.resolved() if child.tag == "ref" else child
            if target.tag == tag:
                child.used = target.used = True
                found.append(target)
        return found

    # --- values -------------------------------------------------------------------------------------------------------

    def text(self, name, usual=""):
        """The value of a child as text."""
        found = self.child(name)
        return usual if found is None else found.attributes.get("value", "").strip()

    def boolean(self, name, usual=False):
        """The value of a child as true or false."""
        found = self.text(name, str(usual).lower()).lower()
        if found not in ("true", "false"):
            raise self.fault(f'{name}="{found}" is neither true nor false')
        return found == "true"

    def number(self, name, usual):
        """The value of a child as a finite number."""
        found = self.child(name)
        if found is None:
            return usual
        numbers = found.numbers()
        if len(numbers) != 1:
            raise self.fault(f"{name} is no number; write one value")
        return float(numbers[0])

    def whole(self, name, usual, low=0, high=1 << 16):
        """The value of a child as a whole number in a range."""
        found = self.number(name, usual)
        if found != int(found) or not low <= found <= high:
            raise self.fault(f"{name} is {found:g}; it is a whole number from {low} to {high}")
        return int(found)

    def index(self, name, usual):
        """An index of refraction, from a number or a name."""
        text = self.text(name, usual).lower()
        if text in INDICES:
            return INDICES[text]
        try:
            found = float(text)
        except ValueError:
            known = ", ".join(INDICES)
            raise self.fault(f'{name}="{text}" is neither a number nor of {known}') from None
        if not 0.0 < found < np.inf:
            raise self.fault(f"{name} is {found:g}; an index of refraction is above 0")
        return found

    def numbers(self, attribute="value"):
        """An attribute as an array of finite numbers, separated by spaces or commas."""
        text = self.attributes.get(attribute, "")
        try:
            found = np.array([float(word) for word in text.replace(",", " ").split()])
        except ValueError:
            hint = "; set the parameter with -D NAME=VALUE" if "$" in text else ""
            raise self.fault(f'{attribute}="{text[:40]}" has a word that is no number{hint}') from None
        if not np.isfinite(found).all():
            raise self.fault(f'{attribute}="{text[:40]}" is not finite')
        return found

    def three(self, usual=0.0):
        """Three numbers: the attributes x, y and z, or a value."""
        if "value" in self.attributes:
            found = self.numbers()
        else:
            found = np.array([self.numbers(a)[:1] if a in self.attributes else [usual] for a in "xyz"]).ravel()
        if found.size not in (1, 3):
            raise self.fault("three numbers are needed")
        return np.broadcast_to(found, 3)

    def vector(self, name):
        """Returns the child element `name` as three numbers, or None without such a child."""
        found = self.child(name)
        return None if found is None else found.three()

    def transform(self, name="to_world"):
        """A transform (4, 4), composed of its steps, the last one outermost."""
        found, matrix = self.child(name), np.eye(4)
        if found is not None and found.tag == "animation":
            self.document.lose(f"{found.title}: the first transform of the animation is used")
            found = found.child(tag="transform")
        for step in found.children if found is not None else ():
            matrix = step.step() @ matrix
        if not np.isfinite(matrix).all():
            raise self.fault(f"{name} is not finite")
        return matrix

    def step(self):
        """The matrix of a step of a transform."""
        match self.tag:
            case "matrix":
                return self.matrix()
            case "translate":
                return moved(self.three())
            case "scale":
                return np.diag([*self.three(1.0), 1.0])
            case "rotate":
                return self.rotation()
            case "lookat":
                return self.look_at()
        raise self.fault("this step of a transform is unknown: steps are matrix, translate, scale, rotate and lookat")

    def matrix(self):
        numbers = self.numbers()
        if numbers.size not in (9, 16):
            raise self.fault(f"a matrix has 9 or 16 numbers, not {numbers.size}")
        found, side = np.eye(4), 3 if numbers.size == 9 else 4
        found[:side, :side] = numbers.reshape(side, side)
        return found

    def rotation(self):
        axis, angle = self.three(), np.radians(self.numbers("angle"))
        length = np.linalg.norm(axis)
        if not length > 0.0 or angle.size != 1:
            raise self.fault("a rotation has an axis and an angle")
        # Mitsuba 2 and 3 do not normalise the axis, so that other axes also scale and shear.
        x, y, z = axis = axis / length if self.version < 2 else axis
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        found, (sine, cosine) = np.eye(4), (np.sin(angle), np.cos(angle))
        found[:3, :3] = cosine * np.eye(3) + sine * cross + (1.0 - cosine) * np.outer(axis, axis)
        return found

    def look_at(self):
        points = [self.numbers(key) for key in ("origin", "target")]
        up = self.numbers("up") if "up" in self.attributes else np.array([0.0, 1.0, 0.0])
        if any(point.size != 3 for point in (*points, up)):
            raise self.fault("origin, target and up are three numbers each")
        ahead = points[1] - points[0]
        left = np.cross(up, ahead)
        if not np.linalg.norm(left) > 0.0:
            # Mitsuba chooses any axis if the view is parallel to `up`.
            left = np.cross(np.eye(3)[np.argmin(np.abs(ahead))], ahead)
        if not np.linalg.norm(left) > 0.0:
            raise self.fault("origin and target are the same point")
        ahead, left = ahead / np.linalg.norm(ahead), left / np.linalg.norm(left)
        found = np.eye(4)
        found[:3] = np.column_stack([left, np.cross(ahead, left), ahead, points[0]])
        return found


def moved(offset):
    """The matrix of a translation."""
    found = np.eye(4)
    found[:3, 3] = offset
    return found


class Document:
    """A scene file with its included files. `elements` are the scene's own; `lose` receives warnings."""

    def __init__(self, path, parameters, lose):
        self.main, self.lose = path, lose
        self.parameters, self.named, self.folders = dict(parameters), {}, [path.parent]
        root = self.parse(path, ())
        self.elements = root.children if root.tag == "scene" else [root]

    def place(self, path, line):
        """A line of a file; the name of the main file is left out, because messages begin with it."""
        return f"line {line}" if path == self.main else f"{path.name}, line {line}"

    def parse(self, path, within):
        """Parse a file. Returns its root."""
        parser, stack, top, count = xml.parsers.expat.ParserCreate(), [], [], 0

        def start(tag, attributes):
            nonlocal count
            count += 1
            if count > MAX_ELEMENTS or len(stack) > MAX_NESTING:
                cause = f"it has more than {MAX_ELEMENTS} elements, or nests them more than {MAX_NESTING} deep"
                raise Unsupported(f"{path.name}: {cause}")
            node = Node(tag, attributes, self.place(path, parser.CurrentLineNumber))
            node.document = self
            (stack[-1].children if stack else top).append(node)
            stack.append(node)

        parser.StartElementHandler, parser.EndElementHandler = start, lambda tag: stack.pop()
        try:
            parser.Parse(path.read_bytes(), True)
        except (xml.parsers.expat.ExpatError, UnicodeError, ValueError, LookupError) as error:
            raise Unsupported(f"{path.name}: it is no XML: {error}") from error
        version = re.match(r"\s*(\d+)", top[0].attributes.get("version", "3"))
        self.fill(top[0], (*within, path), int(version.group(1)) if version else 3)
        return top[0]

    def fill(self, node, within, version):
        """Substitute parameters and included files, and record the ids, in the order of the file."""
        if len(within) > MAX_DEPTH:
            raise node.fault(f"files include each other {MAX_DEPTH} times")
        for key, value in node.attributes.items():
            node.attributes[key] = self.filled(value)
        node.version = version
        if version < 2:
            modernise(node)
        if node.id and node.tag != "ref":
            self.named[node.id] = node
        children, node.children = node.children, []
        for child in children:
            match child.tag:
                case "default":
                    value = self.filled(child.attributes.get("value", ""))
                    self.parameters.setdefault(child.name or "", value)
                case "path":
                    self.folders.insert(0, within[-1].parent / self.filled(child.attributes.get("value", "")))
                case "alias":
                    self.alias(child)
                case "include":
                    part = self.include(child, within)
                    node.children += part.children if part.tag == "scene" else [part]
                case _:
                    self.fill(child, within, version)
                    node.children.append(child)

    def alias(self, node):
        """Give an element another id."""
        found = self.named.get(node.id)
        if found is None:
            raise node.fault(f'nothing before it has the id "{node.id}"')
        self.named[node.attributes.get("as", "")] = found

    def include(self, node, within):
        """The root of an included file."""
        name = self.filled(node.attributes.get("filename", ""))
        path = self.find(name)
        if path is None:
            raise Unsupported(f'{node.place}: include "{name}": there is no such file; {self.searched()}')
        if path.resolve() in [other.resolve() for other in within]:
            raise Unsupported(f'{node.place}: include "{name}": the file includes itself')
        return self.parse(path, within)

    def find(self, name):
        """The path of a file of the scene, or None."""
        if not name or "\0" in name:
            return None
        # Windows' exporters write backslashes.
        for folder in self.folders:
            for spelled in (name, name.replace("\\", "/")):
                try:
                    if (folder / spelled).is_file():
                        return folder / spelled
                except OSError:
                    continue
        return None

    def searched(self):
        """The folders that are searched for files, for messages."""
        return f"searched: {', '.join(dict.fromkeys(str(folder) for folder in self.folders))}"

    def filled(self, value):
        """A value with parameters substituted."""
        for name in sorted(self.parameters, key=len, reverse=True):
            if name:
                value = value.replace(f"${name}", self.parameters[name])
        return value

    def file(self, node):
        """The path of an element's file."""
        name = node.text("filename")
        path = self.find(name)
        if path is None:
            raise node.fault(f'filename="{name}": there is no such file; {self.searched()}')
        return path


def modernise(node):
    """Rename an element of Mitsuba 0.x: names in camelCase, and tags."""
    node.tag = {"lookAt": "lookat", "srgb": "rgb"}.get(node.tag, node.tag)
    if node.name:
        node.attributes["name"] = re.sub("(?<=[a-z])[A-Z]+", lambda found: "_" + found.group().lower(), node.name)

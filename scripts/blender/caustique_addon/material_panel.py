"""The caustique panel of a material: presets of glass and water, dispersion, and priority."""

import bpy

from . import text_layout
from .panel import Panel

#: {identifier: (label, description, index of refraction at 589 nm, Abbe number V_d)}
PRESETS = {
    "WATER": ("Water", "Water at 20 degrees Celsius", 1.333, 55.8),
    "GLASS": ("Window Glass", "Soda-lime glass", 1.52, 58.6),
    "CROWN": ("Crown Glass", "Borosilicate crown BK7, the glass of lenses", 1.5168, 64.2),
    "FLINT": ("Flint Glass", "Dense flint SF10, which disperses strongly: prisms, crystal", 1.7283, 28.4),
    "DIAMOND": ("Diamond", "Diamond", 2.4175, 55.3),
}
_ABBE, _PRIORITY = "abbe", "priority"
#: A base colour below this dims clear glass visibly.
_GREY = 0.95


def _glass(material):
    """The Principled or Glass node at the surface of a material, or None."""
    tree = material.node_tree if material is not None else None
    output = tree.get_output_node("CYCLES") if tree is not None else None
    links = output.inputs["Surface"].links if output is not None else ()
    node = links[0].from_node if links else None
    return node if node is not None and node.type in {"BSDF_PRINCIPLED", "BSDF_GLASS"} else None


def _input(node, *names):
    return next((node.inputs[name] for name in names if name in node.inputs), None)


def hint(material):
    """A sentence about a base colour that dims clear glass, or None."""
    node = _glass(material)
    if node is None:
        return None
    clear = node.type == "BSDF_GLASS" or _input(node, "Transmission Weight", "Transmission").default_value >= 0.5
    colour = _input(node, "Base Color", "Color")
    if not clear or colour.is_linked or min(colour.default_value[:3]) >= _GREY:
        return None
    share = min(colour.default_value[:3])
    share = share if node.type == "BSDF_PRINCIPLED" else share ** 2  # of a body with two surfaces
    return (f"Its base colour dims the light behind this glass to {share:.0%}. For clear glass make it white; to tint glass "
            "by its thickness, use a Volume Absorption node")


class MakeGlass(bpy.types.Operator):
    """Make the material this clear substance: white, smooth, with its index of refraction and its dispersion"""

    bl_idname = "caustique.make_glass"
    bl_label = "Clear Substance"
    bl_options = {"UNDO"}

    preset: bpy.props.EnumProperty(name="Substance", items=[(name, *entry[:2]) for name, entry in PRESETS.items()])

    @classmethod
    def poll(cls, context):
        return getattr(context, "material", None) is not None

    def execute(self, context):
        """Set the inputs of the surface's node, or of a new Principled node."""
        material = context.material
        if bpy.app.version < (5, 0, 0):
            material.use_nodes = True
        _, _, ior, abbe = PRESETS[self.preset]
        node = _glass(material)
        if node is None:
            tree = material.node_tree
            node = tree.nodes.new("ShaderNodeBsdfPrincipled")
            output = tree.get_output_node("CYCLES") or tree.nodes.new("ShaderNodeOutputMaterial")
            tree.links.new(node.outputs[0], output.inputs["Surface"])
        values = {("Base Color", "Color"): (1, 1, 1, 1), ("Roughness",): 0.0, ("IOR",): ior, ("Metallic",): 0.0,
                  ("Transmission Weight", "Transmission"): 1.0}
        for names, value in values.items():
            socket = _input(node, *names)
            if socket is not None:
                socket.default_value = value
        material[_ABBE] = abbe
        return {"FINISHED"}


class MaterialPanel(Panel, bpy.types.Panel):
    """Presets of clear substances, dispersion and priority."""

    bl_idname = "CAUSTIQUE_PT_material"
    bl_label = "Glass and Water"
    bl_context = "material"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.material is not None

    def draw(self, context):
        material = context.material
        column = self._column()
        column.operator_menu_enum(MakeGlass.bl_idname, "preset", text="Make It ...", icon="PRESET")
        column.prop(material, "caustique_abbe")
        column.prop(material, "caustique_priority")
        said = hint(material)
        if said is not None:
            text_layout.draw(self.layout, context, said, "INFO")


def _property(key, kind, fallback, **about):
    """A property that is stored as a custom property, which the exporter reads in any Blender."""
    def read(material):
        value = material.get(key, fallback)
        return type(fallback)(value) if isinstance(value, (int, float)) else fallback

    def write(material, value):
        if value == fallback and key in material:
            del material[key]
        elif value != fallback:
            material[key] = value

    return kind(get=read, set=write, **about)


def register():
    """Register the operator, the panel and the properties of materials."""
    bpy.utils.register_class(MakeGlass)
    bpy.utils.register_class(MaterialPanel)
    bpy.types.Material.caustique_abbe = _property(
        _ABBE, bpy.props.FloatProperty, 0.0, name="Abbe Number", min=0, max=200, precision=1,
        description="Abbe number V_d: how little glass spreads white light into its colours. Flint 28, water 56, crown glass "
                    "64; 0 for none")
    bpy.types.Material.caustique_priority = _property(
        _PRIORITY, bpy.props.IntProperty, 0, name="Priority", min=-1000, max=1000,
        description="Where solids overlap, the one with the highest priority fills the space. Let a drink overlap its glass "
                    "slightly, and give the glass 1")


def unregister():
    """Remove the properties, the panel and the operator."""
    del bpy.types.Material.caustique_priority
    del bpy.types.Material.caustique_abbe
    bpy.utils.unregister_class(MaterialPanel)
    bpy.utils.unregister_class(MakeGlass)

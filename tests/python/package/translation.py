"""The modules that translate scenes to Mitsuba and from it, with Mitsuba's scalar variant."""

import importlib

import mitsuba as mi
import shared  # finds them

mi.set_variant("scalar_rgb")
# They are loaded for the variant that is set.
from_xml, gltf, to_xml = (importlib.import_module(name) for name in ("from_xml", "gltf", "to_xml"))
ROOT = shared.ROOT

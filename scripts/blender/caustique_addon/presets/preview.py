"""A picture to judge light and materials by: one minute per frame."""

import bpy

settings = bpy.context.scene.caustique_render
settings.method, settings.finish = "auto", "auto"
settings.use_time, settings.time = True, 60
settings.use_iterations, settings.use_error = False, False

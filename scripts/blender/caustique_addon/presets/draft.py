"""A picture in seconds: a few iterations, denoised."""

import bpy

settings = bpy.context.scene.caustique_render
settings.method, settings.finish = "auto", "full"
settings.use_iterations, settings.iterations = True, 4
settings.use_time, settings.use_error = False, False

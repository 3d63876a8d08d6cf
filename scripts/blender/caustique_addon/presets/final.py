"""A finished picture: an estimated error of 1 %, after at most 4096 iterations."""

import bpy

settings = bpy.context.scene.caustique_render
settings.method, settings.finish = "auto", "auto"
settings.use_error, settings.error = True, 1
settings.use_iterations, settings.iterations = True, 4096
settings.use_time = False

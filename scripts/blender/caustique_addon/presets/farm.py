"""The same work on every machine: a number of iterations, and no limit that depends on the machine's speed."""

import bpy

settings = bpy.context.scene.caustique_render
settings.method, settings.finish = "auto", "auto"
settings.use_iterations, settings.iterations = True, 256
settings.use_time, settings.use_error = False, False

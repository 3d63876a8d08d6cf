"""A number of iterations and no other limit, so that the picture does not depend on the speed of the machine."""

import bpy

settings = bpy.context.scene.caustique_render
settings.method, settings.finish = "auto", "auto"
settings.use_iterations, settings.iterations = True, 256
settings.use_time, settings.use_error = False, False

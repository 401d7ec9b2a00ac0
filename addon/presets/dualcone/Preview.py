"""A quick look: few samples, few bounces, frames on their own."""

import bpy

settings = bpy.context.scene.dualcone

settings.samples = 8
settings.method = "DUAL_CONE"
settings.block = 7
settings.window = 1
settings.max_bounces = 4
settings.diffuse_bounces = 2
settings.glossy_bounces = 2
settings.transmission_bounces = 4
settings.volume_bounces = 0
settings.transparent_max_bounces = 8

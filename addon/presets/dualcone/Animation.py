"""Frames of an animation, sharing samples with the frames around them."""

import bpy

settings = bpy.context.scene.dualcone

settings.samples = 32
settings.method = "DUAL_CONE"
settings.block = 7
settings.window = 3
settings.max_bounces = 12
settings.diffuse_bounces = 4
settings.glossy_bounces = 4
settings.transmission_bounces = 12
settings.volume_bounces = 0
settings.transparent_max_bounces = 8

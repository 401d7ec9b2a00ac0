"""Finds simulations that are not baked: looking ahead in time makes their result depend on luck."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from .report import Warnings

ADVICE = "is not baked, its frames may be wrong: bake it before rendering"

CACHED_MODIFIERS = {"CLOTH": "cloth", "SOFT_BODY": "soft body"}


def warn_of_unbaked(depsgraph: bpy.types.Depsgraph, warnings: Warnings) -> None:
    """Warn once of every simulation whose cache is not baked."""
    scene = depsgraph.scene
    bodies = scene.rigidbody_world
    if bodies and bodies.enabled and bodies.collection and not bodies.point_cache.is_baked:
        warnings.add(scene.name, f"the rigid body simulation {ADVICE}")
    for owner in scene.objects:
        if owner.hide_render:
            continue
        for kind in _unbaked(owner):
            warnings.add(owner.name, f"the {kind} simulation {ADVICE}")


def _unbaked(owner: bpy.types.Object) -> Iterator[str]:
    for modifier in owner.modifiers:
        if not modifier.show_render:
            continue
        if modifier.type in CACHED_MODIFIERS and not modifier.point_cache.is_baked:
            yield CACHED_MODIFIERS[modifier.type]
        if modifier.type == "FLUID" and _is_unbaked_fluid(modifier):
            yield "fluid"
        if modifier.type == "PARTICLE_SYSTEM" and _is_unbaked_emitter(modifier.particle_system):
            yield "particle"
        if modifier.type == "NODES" and _is_unbaked_nodes(modifier):
            yield "geometry nodes"


def _is_unbaked_fluid(modifier: bpy.types.FluidModifier) -> bool:
    domain = modifier.domain_settings
    return modifier.fluid_type == "DOMAIN" and not domain.has_cache_baked_data


def _is_unbaked_emitter(system: bpy.types.ParticleSystem) -> bool:
    if system.settings.type == "HAIR":
        return system.use_hair_dynamics and not system.point_cache.is_baked
    return system.settings.physics_type != "NO" and not system.point_cache.is_baked


def _is_unbaked_nodes(modifier: bpy.types.Modifier) -> bool:
    """Whether a simulation zone of the modifier has no bake on disk or in the file."""
    return any(
        bake.node is not None
        and bake.node.bl_idname == "GeometryNodeSimulationOutput"
        and not bake.is_baked
        for bake in getattr(modifier, "bakes", ())
    )

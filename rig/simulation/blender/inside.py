"""Runs inside Blender: builds the scene of a folder and renders each camera with Cycles.

``python inside.py FOLDER`` with a Python that has ``bpy``, or ``blender --background --python
inside.py -- FOLDER``. The folder is what :mod:`rig.simulation.blender.handoff` writes. For each
camera ``NAME.npy`` comes back: (H, W, 3) float32, linear light, rows from the top. Each is told
by a line ``rendered NAME`` on standard output. Nothing of this project is imported here, because
Blender brings a Python of its own.
"""

from __future__ import annotations

import json
import math
import runpy
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np

_METRES_PER_MM = 1e-3


def main(folder: Path) -> None:
    """Build the scene once, photograph it with each camera."""
    scene = json.loads((folder / "scene.json").read_text(encoding="utf-8"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    # First, so that each camera has its own name whatever else is called so.
    runpy.run_path(str(folder / "cameras_blender.py"))
    _head(folder, scene)
    for light in scene["lights"]:
        _soft_box(light)
    _surroundings(scene)
    _cycles(scene)
    for number, given in enumerate(scene["cameras"]):
        np.save(folder / f"{given['file']}.npy", _rendered(folder, given, number))
        sys.stdout.write(f"rendered {given['name']}\n")
        sys.stdout.flush()


def _head(folder: Path, scene: dict[str, Any]) -> None:
    with np.load(folder / "head.npz") as data:
        vertices, faces, uv, tint = (data[name] for name in ("vertices", "faces", "uv", "tint"))
    mesh = bpy.data.meshes.new("head")
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", (vertices * _METRES_PER_MM).astype(np.float32).ravel())
    mesh.loops.add(faces.size)
    mesh.loops.foreach_set("vertex_index", faces.astype(np.int32).ravel())
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, faces.size, 3, dtype=np.int32))
    mesh.uv_layers.new(name="skin").uv.foreach_set("vector", uv.astype(np.float32).ravel())
    colours = np.concatenate([tint, np.ones((len(tint), 1))], axis=1).astype(np.float32)
    attribute = mesh.color_attributes.new("tint", "FLOAT_COLOR", "POINT")
    attribute.data.foreach_set("color", colours.ravel())
    mesh.update(calc_edges=True)
    mesh.shade_smooth()
    mesh.materials.append(_skin(folder, scene["skin"]))
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("head", mesh))


def _skin(folder: Path, skin: dict[str, Any]) -> Any:  # noqa: ANN401 - Blender's own types
    """The skin's picture times tint and grain, with light that wanders below the surface."""
    material = bpy.data.materials.new("skin")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    surface = nodes["Principled BSDF"] if "Principled BSDF" in nodes else _principled(material)
    picture = nodes.new("ShaderNodeTexImage")
    picture.image = bpy.data.images.load(str(folder / "skin.png"))
    picture.interpolation = "Linear"
    tint = nodes.new("ShaderNodeVertexColor")
    tint.layer_name = "tint"
    colour = _product(nodes, links, picture.outputs["Color"], tint.outputs["Color"])
    for spacing_mm in skin["grain_spacings_mm"]:
        factor = _grain(nodes, links, spacing_mm, skin["grain_contrast"])
        colour = _product(nodes, links, colour, factor)
    links.new(colour, surface.inputs["Base Color"])
    surface.inputs["Subsurface Weight"].default_value = skin["subsurface"]
    surface.inputs["Subsurface Radius"].default_value = skin["subsurface_radius_mm"]
    surface.inputs["Subsurface Scale"].default_value = _METRES_PER_MM
    surface.inputs["Roughness"].default_value = skin["roughness"]
    return material


def _principled(material: Any) -> Any:  # noqa: ANN401
    tree = material.node_tree
    surface = tree.nodes.new("ShaderNodeBsdfPrincipled")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(surface.outputs["BSDF"], output.inputs["Surface"])
    return surface


def _product(nodes: Any, links: Any, first: Any, second: Any) -> Any:  # noqa: ANN401
    product = nodes.new("ShaderNodeVectorMath")
    product.operation = "MULTIPLY"
    links.new(first, product.inputs[0])
    links.new(second, product.inputs[1])
    return product.outputs["Vector"]


def _grain(nodes: Any, links: Any, spacing_mm: float, contrast: float) -> Any:  # noqa: ANN401
    """Blender's own noise in the head's own coordinates, as factors about 1."""
    places = nodes.new("ShaderNodeTexCoord")
    noise = nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 1.0 / (spacing_mm * _METRES_PER_MM)
    noise.inputs["Detail"].default_value = 0.0
    links.new(places.outputs["Object"], noise.inputs["Vector"])
    spread = nodes.new("ShaderNodeMapRange")
    spread.clamp = False
    spread.inputs["To Min"].default_value = 1.0 - contrast
    spread.inputs["To Max"].default_value = 1.0 + contrast
    links.new(noise.outputs["Fac"], spread.inputs["Value"])
    return spread.outputs["Result"]


def _soft_box(light: dict[str, Any]) -> None:
    data = bpy.data.lights.new("soft box", "AREA")
    data.shape = "DISK"
    data.size = light["size_mm"] * _METRES_PER_MM
    data.color = light["colour"]
    place = np.array(light["position_rig_mm"]) * _METRES_PER_MM
    # A disk of power P lights a card at distance d with P / (pi d^2), which returns P / (pi d)^2.
    data.energy = light["power"] * (math.pi * float(np.linalg.norm(place))) ** 2
    holder = bpy.data.objects.new("soft box", data)
    holder.location = place
    from mathutils import Vector

    holder.rotation_euler = (-Vector(place)).to_track_quat("-Z", "Y").to_euler()
    holder.visible_camera = False
    bpy.context.scene.collection.objects.link(holder)


def _surroundings(scene: dict[str, Any]) -> None:
    """The same light from everywhere; a camera that looks past the head sees the backdrop."""
    world = bpy.data.worlds.new("surroundings")
    bpy.context.scene.world = world
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    output, mix = nodes.new("ShaderNodeOutputWorld"), nodes.new("ShaderNodeMixShader")
    path = nodes.new("ShaderNodeLightPath")
    links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
    for number, colour in ((1, [scene["ambient"]] * 3), (2, scene["backdrop"])):
        background = nodes.new("ShaderNodeBackground")
        background.inputs["Color"].default_value = (*colour, 1.0)
        links.new(background.outputs["Background"], mix.inputs[number])
    links.new(mix.outputs["Shader"], output.inputs["Surface"])


def _cycles(scene: dict[str, Any]) -> None:
    ours = bpy.context.scene
    ours.render.engine = "CYCLES"
    ours.cycles.device = "CPU"
    ours.cycles.samples = scene["samples"]
    # Fewer samples where the picture is smooth, and painted over: both would be seen as texture.
    ours.cycles.use_adaptive_sampling = False
    ours.cycles.use_denoising = False
    ours.cycles.pixel_filter_type = "BOX"
    ours.cycles.max_bounces = 4
    ours.render.threads_mode = "FIXED"
    ours.render.threads = scene["threads"]
    ours.view_settings.view_transform = "Raw"
    picture = ours.render.image_settings
    picture.file_format, picture.color_mode, picture.color_depth = "OPEN_EXR", "RGB", "32"


def _rendered(folder: Path, given: dict[str, Any], number: int) -> Any:  # noqa: ANN401
    scene = bpy.context.scene
    scene.camera = bpy.data.objects[given["name"]]
    scene.camera.data.dof.use_dof = given["depth_of_field"]
    scene.camera.data.clip_start = 1e-3
    scene.render.resolution_x, scene.render.resolution_y = given["image_size_px"]
    scene.cycles.seed = number
    path = folder / "rendered.exr"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path), check_existing=False)
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    values = np.empty(width * height * image.channels, dtype=np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    path.unlink()
    # Blender counts rows from the bottom.
    return values.reshape(height, width, -1)[::-1, :, :3]


if __name__ == "__main__":
    main(Path(sys.argv[-1]))

# SPDX-License-Identifier: Apache-2.0
"""The same transfer by Blender: a bake of what the source emits onto the target, "selected to active".

  blender --background --factory-startup --python blender_bake.py -- SOURCE.obj TARGET.obj OUTPUT.png SIZE
"""
import sys

import bpy

source, target, output, size = sys.argv[sys.argv.index("--") + 1:]
bpy.ops.wm.read_factory_settings(use_empty=True)


def imported(path):
    bpy.ops.object.select_all(action="DESELECT")
    if hasattr(bpy.ops.wm, "obj_import"):
        bpy.ops.wm.obj_import(filepath=path)
    else:
        bpy.ops.import_scene.obj(filepath=path, use_split_objects=False, use_split_groups=False)
    return bpy.context.selected_objects[0]


heavy, light = imported(source), imported(target)
for material in heavy.data.materials:
    nodes, links = material.node_tree.nodes, material.node_tree.links
    surface = next(n for n in nodes if n.type == "BSDF_PRINCIPLED")
    output_node = next(n for n in nodes if n.type == "OUTPUT_MATERIAL")
    emission = nodes.new("ShaderNodeEmission")
    links.new(surface.inputs["Base Color"].links[0].from_socket, emission.inputs["Color"])
    links.new(emission.outputs[0], output_node.inputs["Surface"])
image = bpy.data.images.new("baked", int(size), int(size))
light.data.materials.clear()
material = bpy.data.materials.new("target")
material.use_nodes = True
light.data.materials.append(material)
node = material.node_tree.nodes.new("ShaderNodeTexImage")
node.image = image
material.node_tree.nodes.active = node
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.cycles.samples = 1
scene.cycles.use_denoising = False
bake = scene.render.bake
bake.use_selected_to_active = True
bake.cage_extrusion = 0.03 * max(light.dimensions)
bake.max_ray_distance = 2 * bake.cage_extrusion
bake.margin = 4
bpy.ops.object.select_all(action="DESELECT")
heavy.select_set(True)
light.select_set(True)
bpy.context.view_layer.objects.active = light
bpy.ops.object.bake(type="EMIT")
image.filepath_raw = output
image.file_format = "PNG"
image.save()

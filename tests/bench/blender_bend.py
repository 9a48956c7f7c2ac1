"""File to file: Blender's Simple Deform bend.

blender -b --factory-startup --python blender_bend.py -- IN OUT      (both .ply, or both .obj)
Prints "bend: SECONDS s, MEGABYTES MB" from import to export; starting Blender is not in it.
"""
import resource
import sys
import time

import bpy

source, target = sys.argv[sys.argv.index("--") + 1:]
for o in list(bpy.data.objects):
    bpy.data.objects.remove(o)
ply = source.endswith(".ply")
start = time.perf_counter()
if ply:
    bpy.ops.import_mesh.ply(filepath=source)
else:
    bpy.ops.wm.obj_import(filepath=source)
shape = next(o for o in bpy.data.objects if o.type == "MESH")
bpy.context.view_layer.objects.active = shape
shape.select_set(True)
bend = shape.modifiers.new("bend", "SIMPLE_DEFORM")
bend.deform_method, bend.deform_axis, bend.angle = "BEND", "Z", 0.8
bpy.context.view_layer.update()
if ply:
    bpy.ops.export_mesh.ply(filepath=target, use_ascii=False, use_normals=False, use_uv_coords=False, use_colors=False)
else:
    bpy.ops.wm.obj_export(filepath=target, export_materials=False, export_normals=False, export_uv=False)
print("bend: %.2f s, %.0f MB" % (time.perf_counter() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024))

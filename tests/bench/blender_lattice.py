"""CPU time of Blender's lattice modifier (4 x 4 x 4), one control point moved per evaluation.

blender -b --factory-startup --python blender_lattice.py -- VERTICES REPEATS
Prints "lattice: NANOSECONDS CPU-ns a vertex", and "idle: ..." for a modifier stack that runs but displaces nothing (a warp of
strength 0): what the evaluation costs without the deformation. Medians of REPEATS evaluations after one warm-up.
"""
import math
import statistics
import sys
import time

import bpy
import numpy as np

vertices, repeats = (int(a) for a in sys.argv[sys.argv.index("--") + 1:])
for o in list(bpy.data.objects):
    bpy.data.objects.remove(o)

around = int(round(math.sqrt(vertices / 1.6)))
along = vertices // around
u, v = np.meshgrid(np.arange(along) * 2 * np.pi / along, np.arange(around) * 2 * np.pi / around, indexing="ij")
ring = 1 + .35 * np.cos(v)
points = np.stack([ring * np.cos(u), ring * np.sin(u), .35 * np.sin(v)], -1).reshape(-1, 3).astype(np.float32)
i, j = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
at = lambda a, b: (a % along) * around + b % around
quads = np.stack([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], -1).reshape(-1, 4).astype(np.int32)

mesh = bpy.data.meshes.new("torus")
mesh.vertices.add(len(points))
mesh.vertices.foreach_set("co", points.ravel())
mesh.loops.add(quads.size)
mesh.loops.foreach_set("vertex_index", quads.ravel())
mesh.polygons.add(len(quads))
mesh.polygons.foreach_set("loop_start", np.arange(0, quads.size, 4, dtype=np.int32))
mesh.polygons.foreach_set("loop_total", np.full(len(quads), 4, dtype=np.int32))
mesh.update(calc_edges=True)
torus = bpy.data.objects.new("torus", mesh)
bpy.context.collection.objects.link(torus)

lattice = bpy.data.lattices.new("lattice")
lattice.points_u = lattice.points_v = lattice.points_w = 4
box = bpy.data.objects.new("lattice", lattice)
box.scale = (2.8, 2.8, 0.8)
bpy.context.collection.objects.link(box)
torus.modifiers.new("lattice", "LATTICE").object = box
layer = bpy.context.view_layer
layer.update()



def median(change):
    times = []
    for k in range(repeats + 1):
        change(k)
        start = time.process_time()
        layer.update()
        torus.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        times.append(time.process_time() - start)
    return 1e9 * statistics.median(times[1:]) / len(points)


def move_point(k):
    p = lattice.points[21]
    p.co_deform = (p.co_deform[0] + 0.01, p.co_deform[1], p.co_deform[2])
    lattice.update_tag()


def move_target(k):
    target.location = (0.5, 0.4 + 0.02 * k, 0.3)


nanoseconds = median(move_point)
moved = np.empty(points.size, np.float32)
torus.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.vertices.foreach_get("co", moved)
assert np.abs(moved.reshape(-1, 3) - points).max() > 1e-4, "the modifier did not run"
print("lattice: %.1f CPU-ns a vertex" % nanoseconds)

torus.modifiers.clear()
source, target = (bpy.data.objects.new(name, None) for name in ("from", "to"))
for o in (source, target):
    bpy.context.collection.objects.link(o)
warp = torus.modifiers.new("warp", "WARP")
warp.object_from, warp.object_to, warp.strength = source, target, 0
layer.update()
print("idle: %.1f CPU-ns a vertex" % median(move_target))

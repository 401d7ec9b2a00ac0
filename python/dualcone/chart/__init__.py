"""Speed against accuracy: every method and its rivals in one chart.

`python -m dualcone.chart SCENE.blend ...` renders and reports; docs/chart.md explains the output.
It needs bpy (Blender as a Python module), matplotlib, and the add-on, in a checkout or installed.
"""

"""The virtual rig: its description, its MuJoCo model and plugin, and the records it gives.

Importing this package imports neither MuJoCo nor Gymnasium: the modules ``model``, ``plugin`` and
``simulate`` do, and are imported by name where a simulation is wanted.
"""
